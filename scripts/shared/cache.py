"""Results that are kept as long as nothing changes that they depend on.

The key of a result covers the modules that made it with everything that these import, directly or
not, files of data, and words such as versions of tools. Imports are read from the sources, so no
list has to be kept by hand. A module that a program starts by name in another process is not seen:
who does that names it too.

Comments, docstrings and blanks of Python and VHDL are no part of a key: they change no result.
"""

from __future__ import annotations

import ast
import functools
import importlib.util
import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from scripts.shared import tools

PACKAGES = ("directmpc", "scripts")


@functools.cache
def _graph(packages: tuple[str, ...]) -> Any:
    import grimp  # here, not above: who asks for no key needs no graph

    return grimp.build_graph(*packages, cache_dir=None)


def _with_packages(module: str) -> Iterable[str]:
    """A module and the packages around it, whose files are executed with it."""
    parts = module.split(".")
    return (".".join(parts[: n + 1]) for n in range(len(parts)))


def closure(*modules: str, packages: tuple[str, ...] = PACKAGES) -> list[Path]:
    """Files of modules and of all that they import, directly or not, within the packages."""
    graph = _graph(packages)
    found: set[str] = set()
    for module in modules:
        if module not in graph.modules:
            raise tools.ToolError(f"{module}: no module of {' or '.join(packages)}")
        for one in {module, *graph.find_upstream_modules(module)}:
            found |= set(_with_packages(one))
    files = {module: importlib.util.find_spec(module) for module in found}
    return sorted(Path(spec.origin) for spec in files.values() if spec and spec.origin)


@functools.lru_cache(maxsize=1024)
def _without_docstrings(source: str) -> str:
    """What Python executes of a module."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            texts = [one for one in body or () if _is_text(one)]
            node.body = [one for one in node.body if one not in texts]
    return ast.dump(tree)


def _is_text(node: ast.stmt) -> bool:
    """A text that stands alone: a docstring."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def meaning(path: Path) -> bytes:
    """What of a file a result may depend on."""
    if path.suffix == ".py":
        return _without_docstrings(path.read_text(encoding="utf-8")).encode()
    if path.suffix == ".vhd":
        code = re.sub(r"--[^\n]*", "", path.read_text(encoding="utf-8"))
        return " ".join(code.split()).encode()
    return path.read_bytes()


def key(
    modules: Iterable[str],
    *data: str | Path,
    packages: tuple[str, ...] = PACKAGES,
) -> str:
    """Sixteen digits that change with the modules' closure, with files of data and with words."""
    parts: list[str | bytes] = []
    for one in (*closure(*modules, packages=packages), *data):
        if isinstance(one, Path):
            parts += [_place(one), meaning(one)]
        else:
            parts.append(one)
    return tools.digest(*parts)[:16]


def _place(path: Path) -> str:
    """A file's place in the project, wherever that lies; of another file the name."""
    return path.relative_to(tools.ROOT).as_posix() if path.is_relative_to(tools.ROOT) else path.name


def kept(path: Path, compute: Callable[[], Any]) -> Any:
    """What a JSON file holds; if there is none, what is computed, then written."""
    if not path.exists():
        tools.write(path, json.dumps(compute()))
    return json.loads(path.read_text(encoding="utf-8"))
