"""Results that are kept as long as nothing changes that they depend on.

The key of a result covers the modules that made it with everything that these import, directly or
not, files of data, and words such as versions of tools. Imports are read from the sources, so no
list has to be kept by hand. A module that a program starts by name in another process is not seen:
who does that names it too.
"""

from __future__ import annotations

import functools
import importlib.util
import json
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
    """Files of modules and of all that they import, directly or not, within the packages.

    Parameters
    ----------
    *modules : str
        Full names, with dots.
    packages : tuple[str, ...]
        Top packages; what lies elsewhere is pinned by requirements.txt.

    Returns
    -------
    list[Path]
        The files, sorted; the packages around a module are among them.

    Raises
    ------
    ToolError
        If there is no module of that name.
    """
    graph = _graph(packages)
    found: set[str] = set()
    for module in modules:
        if module not in graph.modules:
            raise tools.ToolError(f"{module}: no module of {' or '.join(packages)}")
        for one in {module, *graph.find_upstream_modules(module)}:
            found |= set(_with_packages(one))
    files = {module: importlib.util.find_spec(module) for module in found}
    return sorted(Path(spec.origin) for spec in files.values() if spec and spec.origin)


def key(
    modules: Iterable[str],
    *data: str | Path,
    packages: tuple[str, ...] = PACKAGES,
) -> str:
    """Sixteen digits that change with the modules' closure, with files of data and with words.

    Parameters
    ----------
    modules : Iterable[str]
        Modules that make the result.
    *data : str | Path
        Files by their content; words, versions for instance, as they are.
    packages : tuple[str, ...]
        As of `closure`.

    Returns
    -------
    str
        The digits, hexadecimal.

    Raises
    ------
    ToolError
        If there is no module of that name.
    OSError
        If a file cannot be read.
    """
    files = closure(*modules, packages=packages)
    names = [".".join(path.parts[-3:]) for path in files]
    return tools.digest(*names, *files, *data)[:16]


def kept(path: Path, compute: Callable[[], Any]) -> Any:
    """What a JSON file holds; if there is none, what is computed, then written.

    Parameters
    ----------
    path : Path
        The JSON file; it is written if there is none.
    compute : Callable[[], Any]
        Makes the value, of what JSON can hold; called only if there is no file.

    Returns
    -------
    Any
        The value as the file has it.

    Raises
    ------
    json.JSONDecodeError
        If the file is no JSON.
    """
    if not path.exists():
        tools.write(path, json.dumps(compute()))
    return json.loads(path.read_text(encoding="utf-8"))
