"""The slope from which a current error leaves before it turns, against its definition.

Sweep: without and with the rule inwards; errors anywhere inside bounds of 0 to 29000, with the rule
outside too; all curvatures.
Stimulus: random and corner words; back to back and with idle clocks; inputs random but at the start
edge; a new start in the middle of a search for the minimum.
Checks: the threshold in every clock from the declared one until the next start; that each of the
seven lengths was the minimum at times.
Timing: valid LENGTH_WIDTH + 1 clocks after the edge that takes start.
Does not prove: errors outside on the side where the threshold is void; without the rule on both.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat()


def bench(
    thresholds: int = 1500, throttle: bool = False, rtl: Path = RTL, *, inwards: bool = True
) -> Outcome:
    return run(
        "turn_threshold",
        flat=FLAT,
        generics={"INWARDS": str(inwards).lower()},
        arguments={
            "seed": 4,
            "thresholds": thresholds,
            "throttle": throttle,
            "inwards": inwards,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [False, True], ids=["full speed", "throttled"])
@pytest.mark.parametrize("inwards", [False, True], ids=["dead", "both rules"])
def test_thresholds_follow_the_definition(throttle: bool, inwards: bool) -> None:
    assert bench(throttle=throttle, inwards=inwards).checks["threshold"] >= 1200


test_a_fault_is_seen = seen(
    "turn_threshold",
    lambda rtl: bench(800, rtl=rtl),
    ("if (curvature >= 0)", "if (curvature > 0)", r"threshold:"),
    ("if (left /= 0 and", "if (left > 1 and", r"threshold:"),
    ("choose(INWARDS, 1, 2)", "2", r"threshold:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(800, rtl=RTL)
