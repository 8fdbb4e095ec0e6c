"""Recorder: format of its records, what triggers it, and what a recording says.

Sweep: both controllers, random records and settings.
Checks: no two fields overlap, each comes back with its sign; ring, decimation, triggers with edges
and records behind them, against a search over the whole history; a trace that was packed and
decoded is decided as before, by the bit-true models.
Does not prove: that the RTL does the same, see rtl/system/recorder.
"""

from __future__ import annotations

import random

import numpy as np
import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import recorder
from directmpc.host.recorder import CAUSES, FIELDS, STRIDE, RecorderModel, Recording, Settings
from directmpc.mpdcc import formats


@pytest.mark.parametrize("controller", FIELDS)
def test_fields_do_not_overlap_and_come_back(controller: str) -> None:
    taken: set[tuple[int, int]] = set()
    for f in FIELDS[controller]:
        bits = {(f.word, bit) for bit in range(f.low, f.low + f.width)}
        assert not taken & bits, f.name
        assert f.low + f.width <= 32
        assert f.word < STRIDE
        taken |= bits
    inputs, results = recorder.words(controller)
    assert inputs <= recorder.RESULTS_AT
    assert recorder.RESULTS_AT + results <= STRIDE
    rng = random.Random(1)
    for _ in range(50):
        values = {
            f.name: rng.getrandbits(f.width) - (f.signed << f.width - 1) for f in FIELDS[controller]
        }
        rows = np.array([recorder.pack(controller, values)])
        found = recorder.unpack(controller, rows)
        assert {name: int(value[0]) for name, value in found.items()} == values


def history(rng: random.Random, length: int) -> list[dict[str, int]]:
    """Steps with a slow quantity, rare flags and events."""
    slow, steps = 0, []
    for number in range(length):
        slow = max(-3, min(3, slow + rng.choice((-1, 0, 1))))
        values = {"is_alpha": slow, "v_dc": slow & 0xFFFF, "number": number}
        steps.append(values | {name: int(rng.random() < 0.02) for name in CAUSES[:3]})
    return steps


def wanted(
    steps: list[dict[str, int]], s: Settings, name: str, signed: bool
) -> tuple[list[int], bool, bool]:
    """Numbers of the steps that stay, whether one triggered, and whether it still records."""
    kept: list[int] = []
    first = None
    for n, step in enumerate(steps):
        if first is None:
            value, before = step[name], steps[n - 1][name] if n else None
            level = s.level if signed else s.level & 0xFFFF
            rose = before is not None and before < level <= value
            fell = before is not None and value < level <= before
            hit = (s.rising and rose) or (s.falling and fell) or (s.equal and value == level)
            hit = hit or any(getattr(s, cause) and step[cause] for cause in CAUSES[:3])
            first = n if hit else None
        if n % (s.decimation + 1) == 0 or first == n:
            kept.append(n)
            if first is not None and len([k for k in kept if k > first]) == s.after:
                return kept, True, False
    return kept, first is not None, True


@pytest.mark.parametrize("seed", range(40))
def test_what_stays_is_what_the_settings_say(seed: int) -> None:
    rng = random.Random(seed)
    name = rng.choice(("is_alpha", "v_dc"))
    (f,) = [f for f in FIELDS["mpdcc"] if f.name == name]
    s = Settings(
        **{key: rng.random() < 0.3 for key in ("fault", "deadlock", "saturated")},
        **{rng.choice(("rising", "falling", "equal")): True},
        unsigned=not f.signed, channel=2 * f.word + f.low // 16, level=rng.choice((-3, -1, 2)),
        after=rng.randrange(10), decimation=rng.choice((0, 0, 1, 4)),
    )  # fmt: skip
    model = RecorderModel(4, s)
    model.arm()
    steps = history(rng, rng.choice((5, 30, 120)))
    for step in steps:
        flags = {"deadlock": bool(step["deadlock"]), "saturated": bool(step["saturated"])}
        model.step(recorder.pack("mpdcc", step), tripped=bool(step["fault"]), **flags)
    kept, triggered, recording = wanted(steps, s, name, f.signed)
    assert (model.triggered, model.recording) == (triggered, recording)
    held = model.memory[:, recorder.RESULTS_AT + 2] & 0xFFFF
    whole = min(len(kept), 15)  # the next record's row is being written
    order = [(model.row - n) % 16 for n in range(whole, 0, -1)]
    assert [int(held[row]) for row in order] == kept[len(kept) - whole :]
    assert (model.row, model.full) == (len(kept) % 16, len(kept) >= 16)


def test_a_trip_between_two_decisions_stops_at_once_and_nothing_moves_until_it_is_armed() -> None:
    model = RecorderModel(3)
    for number in range(5):
        model.step(recorder.pack("mptc", {"number": number}))
    model.event(tripped=True)
    assert (model.recording, model.triggered, model.row) == (False, True, 5)
    assert model.cause == dict.fromkeys(CAUSES, False) | {"fault": True}
    before = model.memory.copy()
    model.step(recorder.pack("mptc", {"number": 9}), tripped=True, manual=True)
    model.event(manual=True)
    assert np.array_equal(model.memory, before)
    assert not model.cause["manual"]
    model.arm()
    assert (model.recording, model.triggered, model.row, model.full) == (True, False, 0, False)


def test_a_level_is_given_in_the_units_of_the_drive() -> None:
    drive = load_drive("anpc5l_6kv")
    s = recorder.level(drive, "v_ph_b", 0.55, "falling", after=3)
    assert (s.channel, s.unsigned, s.falling, s.after) == (2 * 3, True, True, 3)
    assert s.level == round(0.55 * formats.CAPACITOR_VOLTAGE.scale)
    s = recorder.level(drive, "applied_next", (6, 2, 1), "equal")
    assert s.level == 6 + 8 * 2 + 64
    for wrong in (("torque", 1.0, "rising"), ("v_dc", 9.0, "rising"), ("v_dc", 1.0, "up")):
        with pytest.raises(ValueError, match="trigger"):
            recorder.level(drive, *wrong)
    with pytest.raises(ValueError, match="three numbers"):
        recorder.level(drive, "applied", (6, 2, 9), "equal")


def test_steps_go_on_across_the_end_of_the_count() -> None:
    rows = np.array([recorder.pack("mptc", {"number": n & 0xFFFF}) for n in (65534, 65535, 2)])
    drive = load_drive("induction_2kw2")
    found = Recording(drive, recorder.unpack("mptc", rows), trigger=1)
    assert found.steps.tolist() == [0, 1, 4]
    assert found.columns["time"] == pytest.approx(np.array([-1, 0, 3]) * drive.control.ts)
