"""Leakage estimate: the RTL against its twin.

Stimulus: a drive's coefficients with a machine of another leakage and noise, words of any content,
all words at their ends; coefficients that change between steps, frozen or not; scalings of the
drive's coefficients and of any; resets; `start` and `scale` repeated while busy and together; any
pause between steps, and none. Ports change as soon as the header allows it.
Checks: theta, the scaled coefficients and both flags bit for bit, valid and busy in every clock;
theta of 1 leaves the coefficients as they are.
Timing: valid 29 clocks after start, busy 28; a scaling takes 16.
Faults: signs and places of the products, the wrong axis, limits, rounding, a step that is not
frozen, a first step that counts, states that survive a reset, each overflow untold or kept.
Does not prove: that the estimate is good for a drive (tb/model/test_leakage.py).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(steps: int, rtl: Path = RTL, pauses: tuple[int, ...] = (0, 0, 1, 5)) -> Outcome:
    return run(
        "leakage_observer",
        "tb.rtl.observers.leakage_observer.bench_leakage_observer",
        units=["leakage_observer"],
        arguments={"seed": 8, "steps": steps, "pauses": pauses},
        rtl=rtl,
    )


@pytest.mark.parametrize("pauses", [(0,), (0, 0, 1, 5)], ids=["full speed", "throttled"])
def test_it_steps_as_its_twin(pauses: tuple[int, ...]) -> None:
    assert bench(420, pauses=pauses).checks["theta"] >= 420


ENTITY = "leakage_observer"
FAULTS = {
    "sign of the cross term": (
        ENTITY,
        "when A_CROSS_BETA =>\n\n        negative := '1';",
        "when A_CROSS_BETA =>\n\n        negative := '0';",
    ),
    "axis": (ENTITY, "measured := psir_beta;", "measured := psir_alpha;"),
    "old current": (ENTITY, "origin   := resize(previous_b", "origin   := resize(previous_a"),
    "current not remembered": (ENTITY, "previous_b <= signed(is_beta);", "null;"),
    "place": (f"{ENTITY}_program", "(16, 2, 1, 0, -1)", "(16, 2, 0, 0, -1)"),
    "early speed": (f"{ENTITY}_program", "(11, 0, 2, 0, 0)", "(10, 0, 2, 0, 0)"),
    "rounding": (ENTITY, "seed(FRACTION - 1) <= rounds;", "seed(FRACTION - 1) <= '0';"),
    "always rounded": (ENTITY, "rounds <= scaling or seeds(SEED_HALF);", "rounds <= '1';"),
    "wrap": (
        ENTITY,
        "clip(signed(total(SUM - 1 downto FRACTION)), WORD)",
        "signed(total(FRACTION + WORD - 1 downto FRACTION))",
    ),
    "frozen": (ENTITY, " and begun = '1' and frozen = '0'", " and begun = '1'"),
    "first step": (ENTITY, " and begun = '1' and frozen = '0'", " and frozen = '0'"),
    "lower limit": (ENTITY, "downto STATE - 2) /= 0", "downto STATE - 3) /= 0"),
    "upper limit": (ENTITY, "moved(MOVE - 1 downto STATE) = 0", "moved(MOVE - 1) = '0'"),
    "survives a reset": (ENTITY, "begun <= '0';", "null;"),
    "theta survives a reset": (ENTITY, "ratio(STATE - 1) <= '1';", "ratio <= ratio;"),
    "order": (ENTITY, "place <= place + 1;", "place <= place - 1;"),
    "scaled while stepping": (ENTITY, "scaling <= scale and not start;", "scaling <= scale;"),
    "overflow untold": (ENTITY, "due(DUE_PHI_ALPHA) = '1' or due(DUE_ERROR_ALPHA) = '1'",
                        "due(DUE_PHI_ALPHA) = '1'"),
    "overflow kept": (ENTITY, "full <= overflow and begun;", "full <= full or overflow;"),
    "clipping untold": (ENTITY, "clipped <= '1';", "clipped <= '0';"),
    "clipping kept": (ENTITY, "clipped <= '0';", "null;"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, *FAULTS[name])
    with pytest.raises(
        CheckError, match=r"(theta|saturated|scaled|clipped|valid|busy)(: got| is undef)"
    ):
        bench(140, rtl)
