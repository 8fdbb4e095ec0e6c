"""``mptc_system`` with methods of two and three vectors: core, sequencer, goals, guard, registers.

Sweep: FAMILY, with and without SENSORLESS; all nine methods.
Stimulus: closed loops of the shipped drive with a plant in float64, gates let through, periods of
400 clocks, exact, or each of another length with early ones among them and with longer minimum
times; vectors shorter than dead and minimum times; running sequences of any content from
registers, a method anew in each decision.
Checks: each decision, on ports and in registers, is the twin's with the sequence that was applied;
gates, running and faults in every clock are those of sequencer, goals and guard as models; flags.
SENSORLESS: speed and flux of each decision are the observer's twin's.
Faults: another sequence in the prediction, or played; no modulation; a goal too early, too late,
lost; an own sequence that is not forgotten; a flux or a speed that is not the observer's.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

EXACT, ANY = (400, 0), (400, 1)


def bench(
    rtl: Path = RTL,
    *,
    sensorless: bool = False,
    methods: tuple[str, ...] = (),
    periods: tuple[tuple[int, int], ...] = (EXACT, ANY),
    steps: int = 6,
    given: int = 0,
) -> Outcome:
    return run(
        "mptc_system",
        "tb.rtl.system.bench_family",
        units=["mptc_system"],
        generics={"FAMILY": "true", "SENSORLESS": str(sensorless).lower()},
        arguments={
            "seed": 5,
            "sensorless": sensorless,
            "methods": methods,
            "periods": periods,
            "steps": steps,
            "given": given,
        },
        rtl=rtl,
        timeout=900,
    )


def test_a_system_plays_what_it_decides() -> None:
    found = bench(methods=("MPTC2", "MPFC3", "SVM"), given=20)
    assert found.covered["delayed"]
    assert found.covered["early"]


def test_a_system_plays_every_method() -> None:
    found = bench(steps=16, given=80)
    assert found.covered["delayed"] >= 5
    assert found.covered["early"] >= 5
    assert found.covered["several"] >= 60


#: All nine methods, a few in a run.
ALL_IN_PARTS = [("MPTC", "MPFC3"), ("MPTC2", "GTV", "MPFC", "SVM"), ("MPTC1", "MPFC2", "MPC2")]


@pytest.mark.parametrize("methods", ALL_IN_PARTS)
def test_a_system_estimates_speed_and_flux(methods: tuple[str, ...]) -> None:
    found = bench(sensorless=True, methods=methods, steps=8)
    assert found.checks["speed"] == 16 * len(methods)


#: Unit, text, what stands there instead, the check that sees it.
FAULTS = {
    "another prediction": (
        "mptc_system", "u2                          => sequence_now.u2",
        "u2                          => sequence_now.u1", "decision|sequence",
    ),
    "another time": (
        "mptc_system", "t2        => own_sequence.t2", "t2        => own_sequence.t1", "gates|flag",
    ),
    "not modulated": (
        "mptc_system", "segmented => own_segmented", "segmented => '0'", "gates|flag",
    ),
    "goal too early": (
        "goal_holder", "(given and waits) or (wanted and not waits)", "wanted", "gates|flag",
    ),
    "untold": ("goal_holder", "asked = '1' or ", "", "gates|flag"),
    "host's sequence": (
        "mptc_system", "to_hardware.running.times.t1.value", "to_hardware.running.times.t2.value",
        "decision|sequence",
    ),
    "not forgotten": (
        "mptc_system", "forget and not deciding and not is_running", "'0'", "decision|sequence",
    ),
    "played behind a stop": (
        "mptc_system", "play_rst <= rst or not current;", "play_rst <= rst;", "gates|running again",
    ),
    "no early": ("mptc_system", "begun(FLAGS - 1) and early", "'0'", "flag"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    entity, old, new, check = FAULTS[name]
    rtl = altered(tmp_path, entity, old, new)
    with pytest.raises(CheckError, match=rf"({check}): .* expected"):
        bench(rtl, methods=("MPFC3", "SVM"), given=8)


#: The same of what the observer gives.
OF_THE_OBSERVER = {
    "measured speed": (
        "core_omega <= observer_speed when", "core_omega <= sample.omega_r.value.value when",
        "speed|decision|sequence",
    ),
    "measured flux": (
        "watching   <= observing and to_std_logic(SENSORLESS or not FAMILY)", "watching <= '0'",
        "decision|flux|sequence",
    ),
    "another voltage": (
        "u3              => sequence_now.u3", "u3              => sequence_now.u1",
        "decision|flux|speed|sequence",
    ),
    "another speed at the port": (
        "speed      <= to_hardware.result.speed.omega_r.value", "speed <= core_omega", "speed port",
    ),
    "another flux at the port": (
        "flux_beta  <= to_hardware.result.stator_flux.beta", "flux_beta <= core_beta; --",
        "flux port",
    ),
    "too late": ("core_start <= speed_valid", "core_start <= observer_valid", "clocks"),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_THE_OBSERVER)
def test_a_fault_of_the_observer_is_found(name: str, tmp_path: Path) -> None:
    old, new, check = OF_THE_OBSERVER[name]
    rtl = altered(tmp_path, "mptc_system", old, new)
    with pytest.raises(CheckError, match=rf"({check}): .* expected"):
        bench(rtl, sensorless=True, methods=("MPFC3",), periods=(EXACT,), steps=10)
