"""The checks of `make lint`: style, docstrings, layers, VHDL analysis, ports, fresh files.

A check is a function that returns the lines to show: what is to be mended, nothing if all is well.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from directmpc import converter
from scripts.hdl import sources
from scripts.hdl.conversion import KEYWORDS
from scripts.shared import tools
from scripts.shared.tools import ROOT, ToolError

CONFIGURATION = ROOT / ".vsg.yaml"
PYTHON_DIRECTORIES = ("model", "scripts", "tb", "examples", "tools")
# Directories `make generate` may write to.
GENERATED_DIRECTORIES = (
    "rtl",
    "docs",
    "model",
    "tb",
    "drives",
    "examples",
    "registers",
    "constraints",
    "converters",
)
# Which name no converter, but in what is generated and in drive files.
ANY_CONVERTER = ("rtl", "model", "scripts")
# Register blocks as PeakRDL writes them.
GENERATED_VHDL = ROOT / "rtl" / "system" / "generated"
# Their package declares functions alone. Names of parameters do not reach a netlist.
REGISTER_FUNCTIONS = GENERATED_VHDL / "reg_utils.vhd"

# Keywords of SystemVerilog that are words of VHDL or types that every design uses.
_VHDL_WORDS = set(
    """
    alias and assert begin case config context default else end event for force function generate
    if inout integer large library nand new nor not null or package parameter property protected
    pure release restrict return sequence signed string strong type unsigned use wait while with
    xnor xor assume cover
    """.split()  # noqa: SIM905
)

_REGION = re.compile(r"\b(generic|port)\s*\(", re.I)
_ENTITY_START = re.compile(r"^\s*entity\s+(\w+)\s+is\b", re.I)
_ENTITY_END = re.compile(r"^\s*end\b", re.I)
_DECLARATION = re.compile(
    r"^\s*(?:signal\s+|constant\s+)?([a-z]\w*(?:\s*,\s*[a-z]\w*)*)\s*:(?!=)", re.I
)

# What the library offers to users, see `pyproject.toml`.
_IMPORT = re.compile(r"from (directmpc[\w.]*) import (\([^)]*\)|[^\n(]+)")
_DOTTED = re.compile(r"\bdirectmpc(?:\.\w+)+")
_SECTION = re.compile(r"^\w[\w ]*\n-{3,}$", re.M)
_PLACE = re.compile(r"(\S+\.py):(\d+): ")
#: Questions for the kind of a drive that are left in a folder: this number only falls.
KIND_QUESTIONS = {"model": 7, "scripts": 18}
#: What they ask for: classes, and the key `controller` of a drive.
KINDS = re.compile(
    r"(Drive|PerUnitDrive|KbestDrive|MptcDrive|AnyDrive|(Mpdcc|Mptc)(State|Decision|Trace|Errors)"
    r"|Decisions|MptcDecisions|DriveErrors|(Rtl|Model|Ideal)Controller|Run|VectorSequence"
    r"|SimulationResult|InductionMachine|Pmsm|Grid|RlLoad)"
)
CONTROLLERS = {"mpdcc", "mptc", "kbest"}
_Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def _run(command: list[str], environment: dict[str, str] | None = None) -> list[str]:
    """Output of a checker that failed, nothing if it passed."""
    done = subprocess.run(
        command, cwd=ROOT, text=True, capture_output=True, check=False, env=environment
    )
    if done.returncode == 0:
        return []
    return (done.stdout + done.stderr).strip().splitlines() or [f"status {done.returncode}"]


def _written_files() -> list[Path]:
    """VHDL of the design but for what another project's generator wrote, whose style is its own."""
    return [path for path in sources.rtl_files() if GENERATED_VHDL not in path.parents]


def _vhdl_files() -> list[tuple[list[Path], list[Path]]]:
    """VSG's configurations with the files they are for: the design; benches and examples."""
    benches = sorted(
        path for folder in ("examples", "scripts", "tb") for path in (ROOT / folder).rglob("*.vhd")
    )
    on_top = [CONFIGURATION, ROOT / "tb" / ".vsg.yaml"]
    pairs = [([CONFIGURATION], _written_files()), (on_top, benches)]
    return [(configuration, files) for configuration, files in pairs if files]


def _vsg(configuration: list[Path], files: list[Path], *options: str) -> list[str]:
    """VSG's findings; a warning counts as much as an error."""
    command = [*tools.tool("vsg"), "-c", *map(str, configuration), "-of", "syntastic"]
    names = [str(path.relative_to(ROOT)) for path in files]
    command += ["-p", os.environ.get("JOBS", "2"), *options, "-f", *names]
    done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    if done.returncode and not lines:
        lines = done.stderr.strip().splitlines() or [f"vsg ended with {done.returncode}"]
    return lines


def _vhdl_style() -> list[str]:
    """VSG over all VHDL."""
    return [line for pair in _vhdl_files() for line in _vsg(*pair, "--all_phases")]


def _python_directories() -> list[str]:
    return [name for name in PYTHON_DIRECTORIES if (ROOT / name).is_dir()]


def _python_style() -> list[str]:
    """Ruff's rules."""
    return _run(
        [
            *tools.tool("ruff"),
            "check",
            "--quiet",
            "--output-format",
            "concise",
            *_python_directories(),
        ]
    )


def _python_format() -> list[str]:
    """Ruff's formatting."""
    return _run([*tools.tool("ruff"), "format", "--check", "--quiet", *_python_directories()])


def _public_names() -> set[str]:
    """Dotted names that the library's packages export and that pages and examples use."""
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "examples").rglob("*.py")]
    names = set()
    for path in [*(ROOT / "model").rglob("__init__.py"), *filter(Path.is_file, pages)]:
        text = path.read_text(encoding="utf-8")
        names.update(_DOTTED.findall(text))
        for module, imported in _IMPORT.findall(text):
            names.update(f"{module}.{name}" for name in re.findall(r"\w+", imported))
    return names


def _definitions(
    parent: ast.AST, name: str, names: set[str], public: bool = False
) -> Iterator[tuple[_Definition, bool]]:
    """Functions and classes, and whether a user imports them: named, or of a named class."""
    for node in ast.iter_child_nodes(parent):
        if isinstance(node, _Definition):
            own = f"{name}.{node.name}"
            inside_class = isinstance(parent, ast.ClassDef)
            shown = not node.name.startswith("_") and (own in names or (public and inside_class))
            yield node, shown
            yield from _definitions(node, own, names, shown)
        else:
            yield from _definitions(node, name, names, public)


def python_docstrings() -> list[str]:
    """Sections in docstrings of public names, as `pyproject.toml` has them, and in no others."""
    names, public, found = _public_names(), set(), []
    for path in sorted((ROOT / "model").rglob("*.py")):
        file = str(path.relative_to(ROOT))
        module = ".".join(path.relative_to(ROOT / "model").with_suffix("").parts)
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node, shown in _definitions(tree, module, names):
            if shown:
                public.add((file, str(node.lineno)))
            elif _SECTION.search(ast.get_docstring(node) or ""):
                found.append(
                    f"{file}:{node.lineno}: '{node.name}' is not public: one or two lines, "
                    "units and shapes included, in place of sections"
                )
    files = sorted({file for file, _ in public})
    said = _run([*tools.tool("numpydoc"), "lint", "--config", str(ROOT), *files]) if files else []
    for line in filter(None, said):
        place = _PLACE.match(line)
        if not place or place.groups() in public:
            found.append(line)
    return found


def asks_for_kind(node: ast.AST) -> bool:
    """Whether an expression asks for the kind of a drive, a state, a trace or a load."""
    match node:
        case ast.Call(func=ast.Name(id="isinstance" | "issubclass"), args=[_, given]):
            names = (getattr(n, "attr", getattr(n, "id", "")) for n in ast.walk(given))
            return any(map(KINDS.fullmatch, names))
        case ast.Compare(left=left, comparators=others):
            parts = [part for one in (left, *others) for part in getattr(one, "elts", [one])]
            return any(isinstance(p, ast.Constant) and p.value in CONTROLLERS for p in parts)
    return False


def kind_questions() -> list[str]:
    """Questions for the kind, if they are more than are left, and if `KIND_QUESTIONS` can fall."""
    found = []
    for folder, most in KIND_QUESTIONS.items():
        places = [
            f"{path.relative_to(ROOT)}:{node.lineno}"
            for path in sorted((ROOT / folder).rglob("*.py"))
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if asks_for_kind(node)
        ]
        if len(places) > most:
            found += [f"{place}: asks for the kind" for place in places]
            found.append(f"{folder}: {len(places)}; at most {most}: a method of a kind answers")
        elif len(places) < most:
            found.append(f"{folder}: {len(places)} questions for the kind: KIND_QUESTIONS can fall")
    return found


def _on_path() -> dict[str, str]:
    """Environment in which this folder's packages are found, and no others of their names."""
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "model"), str(ROOT)])}


def _layers() -> list[str]:
    """Import-linter over library, tools and tests: `.importlinter` holds the rules."""
    command = [
        *tools.tool("lint-imports"),
        "--no-cache",
        "--no-logo",
        "--config",
        str(ROOT / ".importlinter"),
    ]
    return _run(command, _on_path())


def _picture() -> list[str]:
    """The picture of the layers is the one that `make layers` draws."""
    return _run([sys.executable, "-m", "scripts", "layers", "--check"], _on_path())


def _analysis(std: str) -> list[str]:
    """GHDL accepts all of `rtl/` without a word in one version of the language.

    VHDL-93 is asked of the cores, not of what is below `rtl/system/`.
    """
    files = sources.rtl_files()
    if std == "93":
        files = [path for path in files if not sources.is_wrapper(path)]
    try:
        order = sources.order_all(files)
    except sources.SourcesError as error:
        return [str(error)]
    if not order:
        return []
    with tempfile.TemporaryDirectory(prefix="lint-") as workdir:
        command = [*tools.tool("ghdl"), "-a", f"--std={std}", f"--workdir={workdir}"]
        command += [f"--work={sources.LIBRARY}"]
        names = [str(path.relative_to(ROOT)) for path in order]
        done = subprocess.run(
            [*command, *names], cwd=ROOT, text=True, capture_output=True, check=False
        )
    lines = (done.stdout + done.stderr).strip().splitlines()
    return lines or ([f"ghdl ended with {done.returncode}"] if done.returncode else [])


def undocumented(text: str, name: str) -> list[str]:
    """Ports and generics of the entities in a file without a comment at the end of their line."""
    found: list[str] = []
    entity: str | None = None
    depth = 0
    for number, line in enumerate(text.splitlines(), start=1):
        code, dashes, comment = line.partition("--")
        if entity is None:
            match = _ENTITY_START.match(code)
            if match is None:
                continue
            entity, depth = match.group(1), 0
            code = code[match.end() :]
        if depth == 0 and _ENTITY_END.match(code):
            entity = None
            continue
        opened = _REGION.search(code) if depth == 0 else None
        start = opened.end() if opened else 0
        match = _DECLARATION.match(code[start:]) if depth == 1 or opened else None
        if match and not (dashes and comment.strip()):
            found.append(f"{name}:{number}: {entity}: {match.group(1)} has no comment on its line")
        if depth or opened:
            depth += code[start:].count("(") - code[start:].count(")") + (1 if opened else 0)
    return found


def _documented_ports() -> list[str]:
    """Every port and generic in `rtl/` says its unit, format or polarity in its own line."""
    return [
        line
        for path in sources.rtl_files()
        for line in undocumented(path.read_text(encoding="utf-8"), str(path.relative_to(ROOT)))
    ]


def keyword_names(text: str, name: str) -> list[str]:
    """Names in a VHDL file that are keywords of SystemVerilog: other tools have to rename them."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        code = re.sub(r'"[^"]*"', '""', line).partition("--")[0]
        words = dict.fromkeys(re.findall(r"(?<![\w'])[A-Za-z]\w*", code))
        found += [
            f"{name}:{number}: the name {word} is a keyword of SystemVerilog"
            for word in words
            if word.lower() in KEYWORDS - _VHDL_WORDS
        ]
    return found


def _keyword_names() -> list[str]:
    """No name in `rtl/` is a keyword of SystemVerilog, so that Verilog has the same names."""
    return [
        line
        for path in sources.rtl_files()
        if path != REGISTER_FUNCTIONS
        for line in keyword_names(path.read_text(encoding="utf-8"), str(path.relative_to(ROOT)))
    ]


def converters_named(text: str, name: str) -> list[str]:
    """Lines of a file that name a converter."""
    known = re.compile(rf"\b(?:{'|'.join(converter.shipped())})\b|five[_]level")
    return [
        f"{name}:{number}: names the converter {match[0]}; its file says what it has"
        for number, line in enumerate(text.splitlines(), start=1)
        for match in known.finditer(line)
    ]


def _converters_named() -> list[str]:
    """No source names a converter: each is served as its file describes it."""
    lines = []
    for folder in ANY_CONVERTER:
        for path in sorted((ROOT / folder).rglob("*")):
            within = path.relative_to(ROOT)
            if not {"drives", "converters", "__pycache__"} & set(within.parts) and path.is_file():
                text = path.read_text(encoding="utf-8", errors="ignore")
                if "enerated by" not in text[:2000]:
                    lines += converters_named(text, str(within))
    return lines


def _snapshot() -> dict[Path, bytes]:
    return {
        path: path.read_bytes()
        for folder in GENERATED_DIRECTORIES
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.stat().st_size < 2**22
    }


def _fresh_files() -> list[str]:
    """Generating the generated files again changes none of them (compared without git)."""
    before = _snapshot()
    lines = _run([sys.executable, "-m", "scripts", "generate"], _on_path())
    if lines:
        return lines
    # Only what the generator wrote matters: its files carry its name, others may be being edited.
    after = _snapshot()
    changed = [
        path
        for path, data in after.items()
        if before.get(path) != data and b"enerated by" in data[:2000]
    ]
    return [
        f"{path.relative_to(ROOT)} was out of date and has been generated anew" for path in changed
    ]


CHECKS: dict[str, Callable[[], list[str]]] = {
    "VHDL style (vsg)": _vhdl_style,
    "Python style (ruff check)": _python_style,
    "Python format (ruff format)": _python_format,
    "docstrings (numpydoc)": python_docstrings,
    "kinds of drive": kind_questions,
    "layers (import-linter)": _layers,
    "picture of the layers": _picture,
    "VHDL-93 analysis (ghdl)": lambda: _analysis("93"),
    "VHDL-2008 analysis (ghdl)": lambda: _analysis("08"),
    "ports and generics documented": _documented_ports,
    "no keywords of SystemVerilog": _keyword_names,
    "no converter by name": _converters_named,
    "generated files up to date": _fresh_files,
}


@dataclass(frozen=True)
class Finding:
    """What one check found."""

    name: str  #: Of the check.
    lines: list[str]  #: What is to be mended; none if the check passed.
    seconds: float  #: How long it took.


def named(words: Sequence[str]) -> list[str]:
    """Names of the checks that have one of the words in them; of all checks without words."""
    small = [word.lower() for word in words]
    return [name for name in CHECKS if not small or any(word in name.lower() for word in small)]


def findings(names: Sequence[str]) -> Iterator[Finding]:
    """Run checks one after the other; a tool that is missing is a finding, too."""
    for name in names:
        began = time.perf_counter()
        try:
            lines = CHECKS[name]()
        except ToolError as error:
            lines = [str(error)]
        yield Finding(name, lines, time.perf_counter() - began)


def rewrite() -> tuple[list[str], bool]:
    """Let VSG and ruff rewrite what they can."""
    said = [line for pair in _vhdl_files() for line in _vsg(*pair, "--fix")]
    clean = not said
    for words in (("check", "--fix"), ("format",)):
        command = [*tools.tool("ruff"), *words, *_python_directories()]
        done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, check=False)
        said += (done.stdout + done.stderr).strip().splitlines()
        clean = clean and done.returncode == 0
    return said, clean
