"""Speed-adaptive observer: the RTL against its twin, and its netlist.

Stimulus: currents and sequences of a closed loop, currents near the estimate, words, sequences and
coefficients of any content; inputs that change in every clock but the start's, `start` repeated
while busy, steps without and with pauses; a reset at every clock of a step.
Checks: speed, flux and flag bit for bit; valid, speed_valid and busy in every clock.
Timing: speed_valid 22, valid 48 clocks after start, always.
Faults: a sign, a place, a gain and a clock of the program, the position of eps, the speed in place
of its integral, an overflow and each port's untold, a vector's time, times longer than a period,
half steps taken late, what survives a reset: each must turn the bench red.
Does not prove: that the estimate is good for a drive (tb/model/test_sensorless.py).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import formats as f
from directmpc.mptc import speed_observer
from scripts.hdl import netlist_check
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from scripts.studies.sensorless import sensorless_drive
from tb.helpers import mptc_rows as core
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

ENTITY = "mptc_speed_observer"
PROGRAM = f"{ENTITY}_program"


def bench(steps: int, rtl: Path = RTL, *, pauses: bool = False, resets: bool = False) -> Outcome:
    return run(
        ENTITY, arguments={"seed": 4, "steps": steps, "pauses": pauses, "resets": resets}, rtl=rtl
    )


@pytest.mark.parametrize("pauses", [False, True], ids=["full speed", "throttled"])
def test_it_steps_as_its_twin(pauses: bool) -> None:
    found = bench(600, pauses=pauses)
    assert found.checks["estimate"] >= 600
    assert found.checks["speed"] >= 600
    assert found.covered["speed saturated"] >= 10


def test_a_reset_at_any_clock_leaves_nothing() -> None:
    assert bench(0, resets=True).checks["pulse"] >= 3 * 48


def test_the_netlist_steps_as_the_twin() -> None:
    rng, n = np.random.default_rng(9), 3000
    own = speed_observer.coefficients(sensorless_drive(core.shipped("induction_2kw2")))
    state = np.zeros(5, dtype=np.int64)
    inputs: dict[str, list[int]] = {}
    found: dict[str, list[int]] = {}
    for k in range(n):
        # coefficients of any size in every fourth stretch of forty steps
        sizes = 2 ** rng.integers(8, 18, len(own))
        drawn = [int(rng.integers(-size, size)) for size in sizes]
        c = dict(zip(own, drawn, strict=True)) if k // 40 % 4 == 3 else own
        m = np.array([*rng.integers(-3000, 3000, 2), rng.integers(30_000, 35_000)])
        t1 = int(rng.integers(0, 4097))
        applied = np.array([*rng.integers(0, 8, 3), t1, rng.integers(0, 4097 - t1)])
        got = speed_observer.step_words(speed_observer.array(c), state, m, applied)
        row = dict(zip(("is_alpha", "is_beta", "v_dc"), m, strict=True))
        row |= dict(zip(("u1", "u2", "u3", "t1", "t2"), applied, strict=True))
        row |= {f"c_{name}": value for name, value in c.items()}
        for name, value in row.items():
            inputs.setdefault(name, []).append(int(value))
        names = ("omega_r", "psis_alpha", "psis_beta", "saturated")
        for name, value in zip(names, got, strict=True):
            found.setdefault(name, []).append(int(value))
    times = {"t1": 13, "t2": 13}
    ports = netlist_check.Ports(
        inputs={
            name: times.get(name, 3 if name[0] == "u" else 16 if name[0] != "c" else f.WORD_WIDTH)
            for name in inputs
        },
        outputs={"omega_r": 16, "psis_alpha": 16, "psis_beta": 16, "saturated": 1},
        hold=tuple(name for name in inputs if name.startswith("c_")),
    )
    cycles = [clocks_of(ENTITY, "latency")] * n
    result = netlist_check.check(ENTITY, None, inputs, found, cycles, ports=ports, limit=100)
    assert result.checked == n
    assert result.mismatches == []
    assert 100 < sum(found["saturated"]) < n - 100


FAULTS = {
    "sign of eps": (PROGRAM, "(11, 7, 14, 0, -1)", "(11, 6, 14, 0, -1)"),
    "gain": (PROGRAM, "(16, 15, 11, 0, 8)", "(16, 15, 12, 0, 8)"),
    "early speed": (PROGRAM, "14, 18, 19, 20, 23", "14, 18, 18, 20, 23"),
    "position": (ENTITY, "FRACTION - ERROR_SHIFT", "FRACTION - ERROR_SHIFT + 1"),
    "speed kept": (
        ENTITY,
        "coarse(following(4), GUARD)",
        "coarse(state(4), GUARD)",
    ),
    "offset of a half step": (ENTITY, "- resize(origin(", "- 1 - resize(origin("),
    "half step": (ENTITY, "due(DUE_HALF_W) = '1'", "due(DUE_W_ALPHA) = '1'"),
    "time": (ENTITY, "(u1, u2, u3, t1, t2);", "(u1, u2, u3, t1, t1);"),
    "long times": (ENTITY, "fitted(given);", "given;"),
    "flag of long times": (ENTITY, "or long or", "or"),
    "late start": (ENTITY, "(active = '0' and start = '1')", "(start = '1')"),
    "share": ("mptc_mean_share", "- t1 - t2;", "- t1;"),
    "port": (ENTITY, "clip(rounded(state(2), PORT_SHIFT), PORT_WIDTH)", "state(2)(25 downto 10)"),
    "flag": (ENTITY, "saturated  <= overflow or", "saturated  <= '0' or"),
    "flag of alpha's port": (ENTITY, "or overflows(rounded(state(2), PORT_SHIFT), PORT_WIDTH)", ""),
    "flag of beta's port": (ENTITY, "or overflows(rounded(state(3), PORT_SHIFT), PORT_WIDTH)", ""),
    "flag of the speed's port": (
        ENTITY,
        "as_one or overflows(rounded(following(4), PORT_SHIFT), PORT_WIDTH);",
        "as_one;",
    ),
    "flag of eps": (ENTITY, "as_one := overflows(error_sum, WORD_WIDTH);", "null;"),
    "survives a reset": (ENTITY, "state <= (others => (others => '0'));", "null;"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, *FAULTS[name])
    check = r"(estimate|speed|saturated|pulse|speed_valid): got|is undefined"
    with pytest.raises(CheckError, match=check):
        bench(110, rtl)


@pytest.mark.parametrize(
    "name",
    ["        found       <= '0';\n", "        speed_valid <= '0';\n"],
    ids=["found", "pulse"],
)
def test_a_fault_is_seen_after_a_reset(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, ENTITY, name, "        null;\n")
    with pytest.raises(CheckError, match="pulse: got"):
        bench(0, rtl, resets=True)
