"""Random life of a gate guard: mostly a drive that runs, sometimes everything at once."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from dataclasses import replace

from directmpc.host.gate_guard import LEGS, GateGuard, Inputs
from tb.helpers.scoreboard import word


def early(rows: Iterable[Inputs]) -> Iterator[tuple[Inputs, Inputs]]:
    """Inputs of the reference, and those of the ports: positions a clock before their decision."""
    last: Inputs | None = None
    for i in rows:
        if last is not None:
            yield last, _with_positions(last, i)
        last = i
    if last is not None:
        yield last, last


def _with_positions(i: Inputs, of: Inputs) -> Inputs:
    return replace(i, position_a=of.position_a, position_b=of.position_b, position_c=of.position_c)


def _settings(rng: random.Random, tabled_leg: bool | str) -> dict[str, int]:
    """Times a drive can run with, or anything."""
    if rng.random() < 0.1:
        return {
            "dead_time": rng.getrandbits(12),
            "minimum_on": rng.getrandbits(12),
            "minimum_off": rng.getrandbits(12),
            "decision_limit": rng.getrandbits(16),
            "watchdog": rng.getrandbits(16),
        }
    return {
        "dead_time": rng.randrange(6),
        "minimum_on": rng.randrange(9),
        "minimum_off": rng.randrange(9),
        "decision_limit": rng.randrange(3, 12),
        "watchdog": rng.randrange(30, 60),
    }


def _bands(rng: random.Random, i: Inputs, tabled_leg: bool | str) -> Inputs:
    """Voltages and speed inside their bands or, seldom, beyond; currents that stand still."""
    names = ("v_ph_a", "v_ph_b", "v_ph_c", "v_n", "omega_r")
    found = dict(zip(names, (16_000, 16_000, 16_000, 0, 0), strict=True))
    found = {name: value + rng.randrange(-2000, 2000) for name, value in found.items()}
    if rng.random() < (0.05 if tabled_leg else 0.02):
        name = rng.choice([rng.choice(names[:3]), *names[3:]] if tabled_leg else names[4:])
        limit = {"v_n": i.v_n_limit, "omega_r": i.speed_limit}.get(name, i.v_ph_high)
        low = i.v_ph_low if name.startswith("v_ph") else -limit
        outwards = rng.choice((-1, 0, 1, 1))
        found[name] = rng.choice([limit + outwards, low - outwards])
    return replace(i, **found)


def life(
    rng: random.Random, tabled_leg: bool | str, guard: GateGuard, clocks: int
) -> Iterator[Inputs]:
    """Inputs clock by clock; reads the model's goals to know what is legal."""
    i = Inputs(
        current_limit=12_000,
        link_high=40_000,
        link_low=20_000,
        v_dc=32_000,
        v_ph_high=20_000,
        v_ph_low=12_000,
        v_n_limit=4_000,
        speed_limit=9_000,
        frozen_limit=3,
        **_settings(rng, tabled_leg),
    )
    period, phase, wild = 40, 0, False
    still = 0  # measurements for which the currents stand still
    limit, high = i.current_limit, i.link_high  # after the renew that announces them
    for n in range(clocks):
        i = replace(i, rst=0, clear=0, measured=0, start=0, decided=0, renew=0)
        i.external_trip = i.driver_fault = i.upset = 0
        i.current_limit, i.link_high = limit, high
        if wild and rng.random() < 0.005:
            high = rng.choice([word(rng, 16, signed=False), 65_534, 65_535])
        elif not wild:
            high = 40_000
        if wild and rng.random() < 0.02:
            limit = rng.choice([word(rng, 16, signed=False), 32_766, 32_767])
        elif not wild:
            limit = 12_000
        if n % 700 == 0:
            wild = rng.random() < 0.1
            period = rng.choice([7, 12, 20, 40, 45])
            i = replace(i, **_settings(rng, tabled_leg))
        if n < 2 or rng.random() < 0.0005:
            i.rst = 1
        # a fault is cleared, enable goes down and up again, soon
        if guard.faults and rng.random() < 0.3:
            i.clear = rng.choice([guard.fault_bits, 0x7FFF, rng.getrandbits(15)])
            i.enable = rng.getrandbits(1)
        # it has to stay up until a measurement has been compared
        if not guard.faults and not guard.running and rng.random() < (0.01 if i.enable else 0.3):
            i.enable ^= 1
        if guard.running and rng.random() < 0.001:
            i.enable = 0
        if rng.random() < 0.004:
            i = replace(
                i, **rng.choice([_settings(rng, tabled_leg), {"dead_time": rng.randrange(6)}])
            )
        phase += 1
        if phase >= period:
            phase = 0
            i.start = i.measured = 1
            still = max(still - 1, 0)
            if guard.running and rng.random() < 0.02:
                still = 5
            if not still:
                i.is_alpha, i.is_beta = (rng.randrange(-9000, 9000) for _ in range(2))
            i.v_dc = rng.randrange(24_000, 38_000)
            if rng.random() < 0.02:
                i.is_alpha, i.is_beta = word(rng, 16), word(rng, 16)
            if rng.random() < 0.04:
                i.v_dc = word(rng, 16, signed=False)
            i = _bands(rng, i, tabled_leg)
        late = phase == 3 and rng.random() < 0.02
        hasty = rng.random() < (0.02 if wild else 0.05 if phase == 4 else 0.002)
        if (phase == 3 and not late) or hasty:
            i.decided = 1
            goals = [leg.goal for leg in guard.legs]
            for x in range(3):
                if rng.random() < 0.5:
                    goals[x] = rng.choice(LEGS[tabled_leg].next_positions[goals[x]])
                if rng.random() < 0.01:
                    goals[x] = rng.randrange(8)
            i.position_a, i.position_b, i.position_c = goals
        else:
            i.position_a, i.position_b, i.position_c = (rng.randrange(8) for _ in range(3))
        if rng.random() < 0.0005:
            setattr(i, rng.choice(["external_trip", "driver_fault", "upset"]), 1)
        between = phase < 4 and not guard.running
        if (limit, high) != (i.current_limit, i.link_high) or rng.random() < 0.05 * between + 0.001:
            i.renew = 1
        if rng.random() < 0.01:
            i.measured = 1
        if wild and rng.random() < 0.02:
            i.start = 1
        if not tabled_leg:  # bits that do not count
            i.position_a, i.position_b, i.position_c = (
                p & 1 | (n & 3) << 1 for p in (i.position_a, i.position_b, i.position_c)
            )
        yield i
