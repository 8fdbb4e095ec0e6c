"""The file of an FMU: description, binaries, sources, resource, documentation, icon, licence."""

from __future__ import annotations

import hashlib
import os
import re
import struct
import uuid
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

from directmpc import __version__
from directmpc.api.drive_file import AnyDrive
from directmpc.fmu.variables import Model, Variable, controller, plant, system_of
from directmpc.host.registers import CORE_CLOCK
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mptc.drive import MptcDrive
from directmpc.native import library
from directmpc.output_files import replacing

#: Versions of FMI that can be written.
VERSIONS = ("2.0", "3.0")
#: Every member has this time, so that equal FMUs are equal files.
_TIME = (2020, 1, 1, 0, 0, 0)
#: Exponents of kg, m, s, A, rad by unit.
_UNITS = {
    "V": (1, 2, -3, -1, 0), "A": (0, 0, 0, 1, 0), "Hz": (0, 0, -1, 0, 0), "s": (0, 0, 1, 0, 0),
    "H": (1, 2, -2, -2, 0), "Wb": (1, 2, -2, -1, 0), "N.m": (1, 2, -2, 0, 0),
    "rad/s": (0, 0, -1, 0, 1), "Ohm": (1, 2, -3, -2, 0), "N.m/Wb": (0, 0, 0, 1, 0),
}  # fmt: skip
_LICENCES = """\
The controller and the interface are directmpc's, licence Apache-2.0,
https://www.apache.org/licenses/LICENSE-2.0.

The binaries contain the runtime of Verilator (https://verilator.org), copyright Wilson Snyder,
licence LGPL-3.0-only OR Artistic-2.0; its files are in the folder sources/runtime, with their
notices. The other C++ of the folder sources/made is what Verilator makes of directmpc's Verilog.
"""


class FmuError(Exception):
    """An FMU that cannot be written; the message says why."""


def write_controller(
    drive: AnyDrive,
    out: str | os.PathLike[str],
    *,
    version: str = "3.0",
    clock: float = CORE_CLOCK,
    si: bool = False,
    phases: bool = False,
    windows: bool | None = None,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Write the FMU of a drive's controller: the RTL with registers and gate guard.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        Whose controller it is.
    out : str or path
        File to write or to replace.
    version : str
        Of FMI, "2.0" or "3.0".
    clock : float
        Of the core, Hz. The control period has to be a whole number of clocks.
    si : bool
        MPDCC: inputs in SI units; per unit by default. Those of MPTC are SI always.
    phases : bool
        Currents are measured in the phases a, b, c; as alpha and beta by default.
    windows : bool, optional
        Whether binaries for Windows are in it; by default if MinGW is there.
    say : callable, optional
        Is told what goes on, a line at a time; lines go to standard error by default.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FmuError
        If there is no such version.
    NativeError
        If the library cannot be built.
    ValueError
        If the drive has no such FMU; the message names the key.
    OSError
        If the file cannot be written.
    """
    path = Path(out)
    library.verilog_of(system_of(drive))
    model = controller(drive, _identifier(path), clock=clock, si=si, phases=phases)
    return _write(model, path, version, windows, say)


def write_plant(
    drive: PerUnitDrive | MptcDrive,
    out: str | os.PathLike[str],
    *,
    version: str = "3.0",
    windows: bool | None = None,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Write the FMU of a drive's exact plant: machine and inverter at an imposed speed.

    Parameters
    ----------
    drive : PerUnitDrive or MptcDrive
        Whose plant it is; per unit, SI for MPTC.
    out : str or path
        File to write or to replace.
    version : str
        Of FMI, "2.0" or "3.0".
    windows : bool, optional
        Whether binaries for Windows are in it; by default if MinGW is there.
    say : callable, optional
        Is told what goes on, a line at a time; lines go to standard error by default.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FmuError
        If there is no such version.
    NativeError
        If the library cannot be built.
    OSError
        If the file cannot be written.
    """
    path = Path(out)
    return _write(plant(drive, _identifier(path)), path, version, windows, say)


def _identifier(path: Path) -> str:
    """Name of the file as a C identifier."""
    name = re.sub(r"\W", "_", path.stem, flags=re.A)
    return name if re.match(r"[A-Za-z_]", name) else f"_{name}"


def _write(
    model: Model,
    path: Path,
    version: str,
    windows: bool | None,
    say: Callable[[str], None] | None,
) -> Path:
    if version not in VERSIONS:
        raise FmuError(f"version: got {version!r:.20}; it must be {' or '.join(VERSIONS)}")
    if path.suffix != ".fmu":
        raise FmuError(f"{path}: the name of an FMU ends with .fmu")
    said = {} if say is None else {"say": say}
    modern = version == "3.0"
    places = ("x86_64-linux", "x86_64-windows") if modern else ("linux64", "win64")
    binaries = {f"binaries/{places[0]}/{model.name}.so": library.build(model.design, **said)}
    if windows or (windows is None and library.cross_compiler()):
        built = library.build(model.design, **said, windows=True)
        binaries[f"binaries/{places[1]}/{model.name}.dll"] = built
    token = str(uuid.UUID(hashlib.sha256(model.text(version).encode()).hexdigest()[:32]))
    description = _modern(model, token) if modern else _older(model, token)
    icon = "terminalsAndIcons/icon.png" if modern else "model.png"
    members: dict[str, bytes] = {
        "modelDescription.xml": description,
        "resources/unit.txt": model.text(token).encode(),
        "documentation/index.html": _page(model).encode(),
        "documentation/licenses/license.txt": _LICENCES.encode(),
        icon: _icon(),
    }
    if modern:
        members["terminalsAndIcons/terminalsAndIcons.xml"] = _icons()
    built = binaries[f"binaries/{places[0]}/{model.name}.so"]
    with zipfile.ZipFile(built.with_suffix(".zip")) as kept:
        members |= {f"sources/{name}": kept.read(name) for name in kept.namelist()}
        listed = [name for name in kept.namelist() if name.endswith(".cpp")]
    if modern:
        members["sources/buildDescription.xml"] = _build(model, listed)
    else:
        text = f"Compile as C++17, with these folders for headers: {' '.join(library.FOLDERS)}\n\n"
        members["sources/README.txt"] = (text + "".join(f"{file}\n" for file in listed)).encode()
    with (
        replacing(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for member, data in members.items():
            archive.writestr(zipfile.ZipInfo(member, _TIME), data, zipfile.ZIP_DEFLATED)
        for member, file in binaries.items():
            info = zipfile.ZipInfo(member, _TIME)
            info.external_attr = 0o755 << 16
            archive.writestr(info, file.read_bytes(), zipfile.ZIP_DEFLATED)
    return path


def _xml(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True)


def _number(variable: Variable, value: float) -> str:
    if variable.type == "boolean":
        return "true" if value else "false"
    return str(int(value)) if variable.type == "integer" else repr(float(value))


def _units(root: ET.Element, model: Model) -> None:
    section = ET.SubElement(root, "UnitDefinitions")
    for name in sorted({"s"} | {v.unit for v in model.variables if v.unit in _UNITS}):
        exponents = zip(("kg", "m", "s", "A", "rad"), _UNITS[name], strict=True)
        unit = ET.SubElement(section, "Unit", name=name)
        ET.SubElement(unit, "BaseUnit", {k: str(n) for k, n in exponents if n})


def _attributes(variable: Variable) -> dict[str, str]:
    """What a variable has in both versions; unit, range and start apart."""
    causality, variability = {
        "input": ("input", "continuous" if variable.type == "real" else "discrete"),
        "output": ("output", "continuous" if variable.type == "real" else "discrete"),
        "parameter": ("parameter", "fixed"),
        "constant": ("local", "constant"),
    }[variable.role]
    return {
        "description": variable.description,
        "causality": causality,
        "variability": variability,
    }


def _range(variable: Variable) -> dict[str, str]:
    found = {}
    if variable.type == "real" and variable.unit != "1":
        found["unit"] = variable.unit
    if variable.role in ("input", "parameter") and variable.type != "boolean":
        for key, value in (("min", variable.least), ("max", variable.most)):
            if abs(value) < 1e9:
                found[key] = _number(variable, value)
    if variable.role != "output":
        found["start"] = _number(variable, variable.start)
    return found


def _head(model: Model) -> dict[str, str]:
    return {
        "modelName": model.name,
        "description": model.title,
        "author": "directmpc contributors",
        "version": __version__,
        "license": "Apache-2.0",
        "generationTool": f"directmpc {__version__}",
    }


def _experiment(root: ET.Element, model: Model) -> None:
    found = {"startTime": "0", "stopTime": repr(400 * model.step), "stepSize": repr(model.step)}
    ET.SubElement(root, "DefaultExperiment", found)


def _modern(model: Model, token: str) -> bytes:
    """modelDescription.xml of FMI 3.0."""
    root = ET.Element(
        "fmiModelDescription", fmiVersion="3.0", instantiationToken=token, **_head(model)
    )
    able = {
        "modelIdentifier": model.name,
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "canReturnEarlyAfterIntermediateUpdate": "false",
        "fixedInternalStepSize": repr(model.step),
    }
    ET.SubElement(root, "CoSimulation", able)
    _units(root, model)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="error", description="What is refused, and why")
    _experiment(root, model)
    variables = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    kinds = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}
    for number, one in enumerate(model.variables):
        found = {"name": one.name, "valueReference": str(number)}
        ET.SubElement(variables, kinds[one.type], found | _attributes(one) | _range(one))
        if one.role == "output":
            ET.SubElement(structure, "Output", valueReference=str(number))
            ET.SubElement(structure, "InitialUnknown", valueReference=str(number))
    time = {"name": "time", "valueReference": str(len(model.variables))}
    time |= {"causality": "independent", "variability": "continuous", "unit": "s"}
    ET.SubElement(variables, "Float64", time, description="Simulation time")
    outputs = [e for e in structure if e.tag == "Output"]
    unknowns = [e for e in structure if e.tag == "InitialUnknown"]
    structure[:] = [*outputs, *unknowns]
    return _xml(root)


def _older(model: Model, token: str) -> bytes:
    """modelDescription.xml of FMI 2.0."""
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", guid=token, **_head(model))
    able = {
        "modelIdentifier": model.name,
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    ET.SubElement(root, "CoSimulation", able)
    _units(root, model)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="error", description="What is refused, and why")
    _experiment(root, model)
    variables = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    places = [k for k, one in enumerate(model.variables, 1) if one.role == "output"]
    for section in ("Outputs", "InitialUnknowns"):
        listed = ET.SubElement(structure, section)
        for place in places:
            ET.SubElement(listed, "Unknown", index=str(place))
    kinds = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}
    for number, one in enumerate(model.variables):
        found = {"name": one.name, "valueReference": str(number)} | _attributes(one)
        scalar = ET.SubElement(variables, "ScalarVariable", found)
        ET.SubElement(scalar, kinds[one.type], _range(one))
    return _xml(root)


def _build(model: Model, listed: list[str]) -> bytes:
    """sources/buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    section = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    group = ET.SubElement(section, "SourceFileSet", language="C++17")
    for name in listed:
        ET.SubElement(group, "SourceFile", name=name)
    for name in library.FOLDERS:
        ET.SubElement(group, "IncludeDirectory", name=name)
    return _xml(root)


def _icons() -> bytes:
    """terminalsAndIcons.xml of FMI 3.0: where the icon lies."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphic = ET.SubElement(root, "GraphicalRepresentation")
    low, high = {"x1": "-100", "y1": "-100"}, {"x2": "100", "y2": "100"}
    ET.SubElement(graphic, "CoordinateSystem", low | high, suggestedScalingFactorTo_mm="0.1")
    ET.SubElement(graphic, "Icon", low | high)
    return _xml(root)


def _icon() -> bytes:
    """A PNG of 64 by 64: five levels of a phase voltage, dark on light."""
    size, levels = 64, (2, 3, 4, 4, 3, 2, 1, 0, 0, 1, 2)
    heights = [size - 10 - 11 * levels[x * len(levels) // size] for x in range(size)]
    rows = b""
    for y in range(size):
        line = b"\0"
        for x in range(size):
            low, high = sorted((heights[x], heights[max(x - 1, 0)]))
            dark = low - 1 <= y <= high + 1
            line += b"\x1f\x4e\x79" if dark else b"\xf4\xf6\xf8"
        rows += line

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows, 9))
        + chunk(b"IEND", b"")
    )


def _page(model: Model) -> str:
    """documentation/index.html."""
    root = ET.Element("html", lang="en")
    head = ET.SubElement(root, "head")
    ET.SubElement(head, "meta", charset="utf-8")
    ET.SubElement(head, "title").text = model.title
    body = ET.SubElement(root, "body")
    ET.SubElement(body, "h1").text = model.title
    if model.design == "plant":
        texts = [
            "Machine and inverter with ideal switches, exact between two communication points "
            "under constant inputs. Outputs are those at the end of a step.",
            "The way over a step is kept. Steps of one size under one speed are the quickest.",
        ]
    else:
        texts = [
            f"The controller samples its inputs every {model.step:g} s, from the start on, and "
            "decides within the following step. Gates change at their clocks. Outputs are those "
            "at the end of a communication step, so its size says how finely gates are seen. A "
            "step size of one control period is the quickest.",
            "With FMI 3.0 an importer that allows early return gets one at every change of a gate.",
            "A rising edge of enable clears latched faults. The gates come on with the first "
            "decision after it. The guard's parameters can be set before the start; the other "
            "values of the drive are built in, and another drive makes another FMU.",
        ]
    for text in texts:
        ET.SubElement(body, "p").text = text
    table = ET.SubElement(body, "table", border="1")
    row = ET.SubElement(table, "tr")
    for title in ("name", "role", "type", "unit", "start", "range", "description"):
        ET.SubElement(row, "th").text = title
    for one in model.variables:
        row = ET.SubElement(table, "tr")
        found = _range(one)
        span = f"{found['min']} to {found['max']}" if {"min", "max"} <= found.keys() else ""
        cells = (one.name, one.role, one.type, found.get("unit", ""), found.get("start", ""), span,
                 one.description)  # fmt: skip
        for cell in cells:
            ET.SubElement(row, "td").text = cell
    return "<!DOCTYPE html>\n" + ET.tostring(root, encoding="unicode", method="html") + "\n"
