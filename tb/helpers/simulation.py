"""Runs one cocotb module on one VHDL top with GHDL, and believes it only with counted checks."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scripts.hdl.ghdl import BenchError, execute
from scripts.hdl.sources import RTL
from tb.helpers.flat import Flat, wrapper
from tb.helpers.variables import ARGUMENTS, RESULT

#: Variants of the explorer that the benches run, and the generic that selects each.
VARIANTS: dict[str, dict[str, object]] = {
    "paper": {"FOLDED": "true"},
    "fast": {"FOLDED": "false"},
}

RTL_TESTS = Path(__file__).resolve().parents[1] / "rtl"


@dataclass(frozen=True)
class Outcome:
    """What a bench reports."""

    checks: dict[str, int]  #: Comparisons made, by name.
    covered: dict[str, int]  #: How often each thing that had to happen did.
    measured: dict[str, int]  #: Extremes of what was measured, clocks for instance.


def bench_of(top: str) -> str:
    """The cocotb module of an entity's own bench, whatever room it is in."""
    (found,) = RTL_TESTS.glob(f"*/{top}/bench_{top}.py")
    return ".".join(("tb", *found.relative_to(RTL_TESTS.parent).with_suffix("").parts))


def run(
    top: str,
    module: str = "",
    *,
    units: Sequence[str] = (),
    files: Sequence[Path] = (),
    flat: Flat | None = None,
    generics: Mapping[str, object] | None = None,
    arguments: Mapping[str, object] | None = None,
    rtl: Path = RTL,
    timeout: int = 900,
) -> Outcome:
    """Run a bench that keeps a scoreboard and return what it counted.

    Without ``module`` it is the bench of the top, without ``units`` the top is what it needs.

    ``arguments`` reach the cocotb module through the environment, so that it never asks the
    simulator for a generic.  A bench that counted no check has failed.  With ``flat`` the top is a
    wrapper of that entity.
    """
    module, units = module or bench_of(top), units or [top]
    with tempfile.TemporaryDirectory(prefix="directmpc-bench-") as name:
        folder = Path(name)
        result = folder / "outcome.json"
        environment = {
            ARGUMENTS: json.dumps(dict(generics or {}) | dict(arguments or {})),
            RESULT: str(result),
        }
        if flat is not None:
            wrapped = folder / f"{top}_flat.vhd"
            wrapped.write_text(wrapper(top, flat, rtl), encoding="utf-8")
            top, files = f"{top}_flat", [*files, wrapped]
        execute(
            top,
            module,
            folder,
            units=units,
            files=files,
            generics=generics,
            environment=environment,
            rtl=rtl,
            timeout=timeout,
        )
        if not result.exists():
            raise BenchError(f"{module} left no result: it checked nothing")
        outcome = Outcome(**json.loads(result.read_text(encoding="utf-8")))
    if sum(outcome.checks.values()) == 0:
        raise BenchError(f"{module} made no check")
    return outcome
