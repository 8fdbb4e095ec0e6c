"""Cocotb side of ``test_gate_supervisor``."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cocotb

from directmpc.host.gate_guard import FAULTS, TIME_HIGH
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

BIT = {name: 1 << n for n, name in enumerate(FAULTS)}


@dataclass
class Supervisor:
    """When gates may be on, told with absolute times."""

    least: int  #: Least dead time, clocks.
    now: int = 0
    state: str = "off"
    primed: bool = False
    compared: bool = False
    faults: int = 0
    off_since: int = 0
    dead: int = TIME_HIGH
    rest: int = TIME_HIGH
    begun: tuple[int, int] | None = None
    fed: tuple[int, int] = (0, 0)

    def wanted(self, i: Mapping[str, int]) -> bool:
        """Whether gates may be on, as far as enable and faults go."""
        return bool(i["enable"] and self.primed and not self.faults)

    def causes(self, i: Mapping[str, int]) -> int:
        """Faults of this clock."""
        refused = BIT["interlock"] * i["refused"]
        if not self.wanted(i):
            return refused
        edge, found = self.now + 1, i["trips"] | i["bands"] << 9 | refused
        if self.begun is not None and edge > sum(self.begun) and not i["decided"]:
            found |= BIT["late"]
        if self.state != "off" and edge > sum(self.fed) and not i["decided"]:
            found |= BIT["missing"]
        if self.state == "active" and i["decided"]:
            found |= BIT["illegal_edge"] * (not i["legal"]) | BIT["overrun"] * i["blocked"]
        return found

    def outputs(self, i: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        halted = i["rst"] or not self.wanted(i) or self.causes(i)
        begins = i["decided"] and self.compared and not i["renew"]
        return {
            "stop": int(bool(halted or self.state != "active")),
            "admit": int(bool(not halted and self.state == "armed" and begins)),
            "kill": int(i["rst"] or i["refused"]),
            "forget": int(bool(i["renew"] or not self.wanted(i))),
            "dead_now": self.dead,
            "rest_now": self.rest,
            "running": int(self.state == "active"),
            "faults": self.faults,
        }

    def edge(self, i: Mapping[str, int]) -> None:
        """One clock."""
        wanted, causes, was = self.wanted(i), self.causes(i), self.state
        admit = self.outputs(i)["admit"]
        self.now += 1
        off_for = min(self.now - self.off_since - 1, TIME_HIGH)
        quiet = was == "off" and i["dark"]
        rested = wanted and quiet and off_for >= max(self.dead, self.rest)
        if was == "off":
            self.state = "armed" if rested and not causes else "off"
        elif admit:
            self.state = "active"
        elif i["rst"] or not wanted or causes:
            self.state = "off"
        if causes:
            self.primed = False
        elif not i["enable"] and not self.faults:
            self.primed = True
        self.compared = bool(wanted and not i["renew"] and (self.compared or i["checked"]))
        if i["decided"] or not wanted:
            self.begun = None
        if wanted and i["start"] and self.begun is None:
            self.begun = (self.now, i["decision_limit"])
        if i["decided"] or was == "off":
            self.fed = (self.now, i["watchdog"])
        if not quiet:
            self.off_since = self.now
        elif not rested:
            self.dead = max(i["dead_time"], self.least)
            self.rest = max(i["minimum_on"], i["minimum_off"], 1)
        self.faults = self.faults & ~i["clear"] | causes
        if i["rst"]:
            self.state, self.primed, self.compared, self.faults = "off", False, False, 0
            self.begun, self.off_since, self.dead, self.rest = None, self.now, TIME_HIGH, TIME_HIGH


def _settings(rng: random.Random) -> dict[str, int]:
    """Times that let gates come on soon, seldom any."""
    if rng.random() < 0.02:
        names = ("dead_time", "minimum_on", "minimum_off")
        return {rng.choice(names): rng.getrandbits(12)}
    return {
        "dead_time": rng.randrange(8),
        "minimum_on": rng.randrange(10),
        "minimum_off": rng.randrange(10),
        "decision_limit": rng.choice([rng.randrange(3), *rng.choices(range(8, 40), k=3)]),
        "watchdog": rng.choice([rng.randrange(9), rng.getrandbits(16), 30, 40, 50, 60]),
    }


def life(rng: random.Random, guard: Supervisor, clocks: int) -> Iterator[dict[str, int]]:
    """Inputs clock by clock: a drive that runs, and everything that may stop it."""
    settings, enable, quiet, dark = _settings(rng), 0, False, False
    for n in range(clocks):
        quiet = (n // 200) % 3 == 0
        rare = 0.001 if quiet else 0.006
        # before gates are on little time passes
        trip = {"off": 0.01, "armed": 0.01}.get(guard.state, rare / 2)
        # legs take some clocks to go off
        dark = guard.state == "off" and (dark or rng.random() < 0.3)
        if rng.random() < 0.03:
            settings |= _settings(rng)
        if guard.faults:
            enable = int(rng.random() < 0.5)
        elif not enable:
            enable = int(rng.random() < 0.3)
        elif rng.random() < (rare if guard.primed else 0.3):
            enable = 0
        clear = rng.choice([guard.faults, 0x7FFF, rng.getrandbits(15)]) if rng.random() < 0.2 else 0
        yield {
            "rst": int(n < 2 or rng.random() < rare / 2),
            "enable": enable,
            "start": int(rng.random() < 0.1),
            "decided": int(rng.random() < 0.2),
            "legal": int(rng.random() > 5 * rare),
            "blocked": int(rng.random() < 5 * rare),
            "refused": int(rng.random() < trip),
            "dark": int(dark),
            "trips": sum((rng.random() < trip) << k for k in range(4)),
            "bands": sum((rng.random() < trip) << k for k in range(6)),
            "checked": int(rng.random() < 0.2),
            "renew": int(rng.random() < 0.03),
            "clear": clear,
            **settings,
        }


def long_off(guard: Supervisor) -> Iterator[dict[str, int]]:
    """Off for longer than the longest time, which then is over."""
    idle = dict.fromkeys(
        ("rst", "enable", "start", "decided", "blocked", "refused", "trips", "bands", "checked",
         "renew", "clear", "dead_time", "minimum_on", "decision_limit"), 0,
    ) | {"legal": 1, "dark": 1, "watchdog": 100, "minimum_off": TIME_HIGH}  # fmt: skip
    yield idle | {"rst": 1}
    for _ in range(TIME_HIGH + 50):
        yield idle
    for decided in (0, 0, 0, 1, 0):
        yield idle | {"enable": 1, "checked": 1, "decided": decided}
    assert guard.state == "active", guard.state


@cocotb.test()
async def every_clock(dut) -> None:
    """A random life; all outputs before every edge."""
    given = arguments()
    rng = random.Random(2)
    board, clock = Scoreboard(), Clock(dut)
    guard = Supervisor(int(given["LEAST_DEAD_TIME"]))
    last: dict[str, int] = {}
    n = 0
    for stage in (life(rng, guard, given["clocks"]), long_off(guard)):
        for i in stage:
            for name, value in i.items():
                if last.get(name) != value:
                    last[name] = value
                    getattr(dut, name).value = value
            await clock.settle()
            wanted = guard.outputs(i)
            for name in wanted if n > 1 else ():
                board.check(name, number(getattr(dut, name)), wanted[name], f"clock {n}, {i}")
            causes, was = guard.causes(i), guard.state
            guard.edge(i)
            await clock.edge()
            for fault, bit in BIT.items():
                board.cover(f"{fault}, {was}", int(causes & bit > 0))
            board.cover(was)
            n += 1
    anywhere = [fault for fault in BIT if fault not in ("missing", "illegal_edge", "overrun")]
    kinds = [f"{fault}, {state}" for fault in anywhere for state in ("off", "armed", "active")]
    kinds += ["missing, armed", "missing, active", "illegal_edge, active", "overrun, active"]
    board.finish(
        {"stop": given["clocks"]},
        dict.fromkeys(kinds, 1) | {"armed": 500, "active": given["clocks"] // 10},
    )
