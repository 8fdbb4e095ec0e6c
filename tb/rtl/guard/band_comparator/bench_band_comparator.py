"""Cocotb side of ``test_band_comparator``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, word

OUTPUTS = ("capacitor", "neutral", "speed", "frozen")
PHASES = ("v_ph_a", "v_ph_b", "v_ph_c")
SIGNED = ("is_alpha", "is_beta", "v_n", "omega_r")


def _beyond(value: int, limit: int) -> bool:
    return abs(value) > limit or limit > 32766


class Comparator:
    """Plain comparisons of a measurement, and what becomes of it in the two clocks behind."""

    def __init__(self, tabled_leg: bool) -> None:
        self.tabled_leg = tabled_leg
        self.last, self.repeated = (0, 0), 0
        #: Trips of the measurements one and two clocks ago, and whether currents are the old ones.
        self.taken: tuple[set[str], bool] | None = None
        self.found: set[str] = set()
        self.shown: set[str] = set()

    def edge(self, i: Mapping[str, int]) -> None:
        """One clock."""
        self.shown, self.found = self.found, set()
        if self.taken is not None:
            self.found, again = self.taken
            again = again and i["running"] == 1
            self.repeated = min(self.repeated + 1, 255) if again else 0
            if again and 0 < i["frozen_limit"] <= self.repeated:
                self.found = self.found | {"frozen"}
        self.taken = None
        if i["measured"]:
            trips = {"speed"} if _beyond(i["omega_r"], i["speed_limit"]) else set()
            voltages = [i[name] for name in PHASES]
            inside = i["v_ph_low"] <= min(voltages) and max(voltages) <= i["v_ph_high"] < 65535
            if self.tabled_leg and not inside:
                trips.add("capacitor")
            if self.tabled_leg and _beyond(i["v_n"], i["v_n_limit"]):
                trips.add("neutral")
            currents = i["is_alpha"], i["is_beta"]
            self.taken = trips, currents == self.last
            self.last = currents
        if i["rst"]:
            self.__init__(self.tabled_leg)


def _limits(rng: random.Random) -> dict[str, int]:
    """Limits that often let everything pass, and the ends of their ranges."""
    low = rng.choice([0, 1, rng.randrange(65536), rng.randrange(20_000)])
    return {
        "v_ph_low": low,
        "v_ph_high": rng.choice([0, 65534, 65535, low, rng.randrange(low, 65536)]),
        "v_n_limit": rng.choice([0, 32766, 32767, 32768, 65535, rng.randrange(32767)]),
        "speed_limit": rng.choice([0, 32766, 32767, 32768, 65535, rng.randrange(32767)]),
    }


def _measured(rng: random.Random, limits: Mapping[str, int]) -> dict[str, int]:
    """Voltages and a speed at their limits, one LSB beside them, and anywhere."""
    found = {}
    for name in PHASES:
        middle = (limits["v_ph_low"] + limits["v_ph_high"]) // 2
        near = rng.choice([middle, middle, middle, limits["v_ph_low"], limits["v_ph_high"]])
        found[name] = min(max(near + rng.choice((-1, 0, 1)), 0), 65535)
    for name, limit in (("v_n", "v_n_limit"), ("omega_r", "speed_limit")):
        near = rng.choice((-1, 0, 1)) * limits[limit] + rng.choice((-1, 0, 1))
        found[name] = rng.choice([min(max(near, -32768), 32767), word(rng, 16)])
    return found


@cocotb.test()
async def bands_and_repetitions(dut) -> None:
    """A measurement in most clocks; limits and whether it runs change every few."""
    given = arguments()
    clocks, tabled_leg = given["clocks"], given["tabled_leg"]
    rng = random.Random(3)
    board, clock, model = Scoreboard(), Clock(dut), Comparator(tabled_leg)
    limits, frozen, running, currents, kept = _limits(rng), 1, 1, (0, 0), 0.8
    for k in range(clocks):
        if rng.random() < 0.1:
            limits = _limits(rng)
        if rng.random() < (0.002 if frozen > 250 else 0.02):
            frozen = rng.choice([0, 1, 2, 3, 7, 254, 255])
            # long enough for the longest count, now and then
            kept = 1.0 if frozen > 250 else rng.choice([0.3, 0.8, 0.95])
            running = 1
        if rng.random() < (0.0005 if frozen > 250 else 0.05):
            running = rng.getrandbits(1)
        if rng.random() >= kept:
            alpha, beta = currents
            single = rng.randrange(3)
            currents = (
                alpha if single == 1 else word(rng, 16),
                beta if single == 2 else word(rng, 16),
            )
        resets = 0.001 if frozen > 250 else 0.02
        i = {
            "measured": int(rng.random() < 0.8),
            "running": running,
            "is_alpha": currents[0],
            "is_beta": currents[1],
            **_measured(rng, limits),
            **limits,
            "frozen_limit": frozen,
            "rst": int(k < 2 or rng.random() < resets),
        }
        for name, value in i.items():
            getattr(dut, name).value = bits(value, 16) if name in SIGNED else value
        model.edge(i)
        await clock.tick()
        for name in OUTPUTS:
            if k > 1:
                board.check(
                    name, number(getattr(dut, name)), int(name in model.shown), f"clock {k}, {i}"
                )
                board.cover(name, int(name in model.shown))
                board.cover(f"no {name}", int(name not in model.shown))
        board.cover("a count at its end", int(model.repeated == 255))
    board.finish(
        dict.fromkeys(OUTPUTS, clocks - 2),
        {n: clocks // 40 for n in OUTPUTS if tabled_leg or n in ("speed", "frozen")}
        | {f"no {n}": clocks // 20 for n in OUTPUTS}
        | {"a count at its end": 20},
    )
