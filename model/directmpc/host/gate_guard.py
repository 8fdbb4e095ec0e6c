"""Reference of the gate guard, clock by clock.

The reference keeps absolute times where the RTL counts down, and one list of planned actions where
the RTL has states; it shares nothing with the RTL but the document docs/gate-guard.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from directmpc.converter import Converter, load, names

#: Faults, bit 0 first.
FAULTS: tuple[str, ...] = (
    "external_trip",
    "over_current",
    "link_high",
    "link_low",
    "illegal_edge",
    "late",
    "missing",
    "overrun",
    "interlock",
    "capacitor",
    "neutral_point",
    "over_speed",
    "frozen",
    "upset",
    "driver",
)

TIME_HIGH = 2**12 - 1


LEGS: dict[bool | str, Converter] = {
    True: next(leg for leg in map(load, names()) if leg.is_default),
    False: next(leg for leg in map(load, names()) if leg.positions == 2),
    **{name: load(name) for name in names()},
}
"""Converters of the guard, by its parameter `tabled_leg`: as the generic of `gate_guard`, where
true is the usual converter's leg, or by name."""


def gates_of(tabled_leg: bool | str, position: int) -> frozenset[int]:
    """Gates that are on in a position 0..7 of a leg of `LEGS`; gate n is the file's switch Sn.

    Of a two-level leg bit 0 counts alone: 1 connects the phase to the positive rail.
    """
    leg = LEGS[tabled_leg]
    return leg.gates[position % leg.positions]


def commutation(tabled_leg: bool | str, origin: int, goal: int) -> list[int]:
    """Single-gate actions from one position to the next (order: docs/gate-guard.md).

    n: gate n on, -n: gate n off. Positions 0..7 (two-level: 0, 1).
    """
    leg = LEGS[tabled_leg]
    return list(leg.commutation(origin % leg.positions, goal % leg.positions))


def stop_clocks(tabled_leg: bool | str, dead_time: int) -> int:
    """Longest time in clocks from a cause at the ports to all gates off.

    The cause takes one clock; a measurement takes three more. The dead time is in clocks.
    """
    return 1 + (LEGS[tabled_leg].stop_steps - 1) * dead_time


@dataclass
class Leg:
    """One leg: a goal, the actions that are planned, what is on."""

    tabled_leg: bool | str  # Key of `LEGS`
    # goal, settled: Position decided last, and the one that the last move begun leads to.
    goal: int = 0
    settled: int = 0
    on: set[int] = field(default_factory=set)  # Gates that are on
    alive: bool = False  # Whether the leg has a position, or is about to have one
    starts_at: int | None = None  # Clock in which the gates of the first position go on
    # Clock and action of what is still to do, see `commutation`.
    plan: list[tuple[int, int]] = field(default_factory=list)
    ready_at: int = 0  # Clock from which on the next move may begin
    changed_at: int = 0  # Clock in which gates changed last

    def stop(self, now: int, dead: int) -> None:
        """Edge `now` of a leg that goes off or is off: step by step, `dead` clocks (1 or more)."""
        self.alive, self.starts_at, self.plan = False, None, []
        leg = LEGS[self.tabled_leg]
        if self.on and (self.on & leg.stop_first or now >= self.changed_at + dead):
            self.on, self.changed_at = set(leg.stop_step(frozenset(self.on))), now

    def kill(self) -> None:
        """All gates off at once."""
        self.on, self.alive, self.starts_at, self.plan = set(), False, None, []

    def legal(self, wanted: int) -> bool:
        """Whether a position follows the goal, or the leg is off; always of a two-level leg."""
        if not self.alive or not self.tabled_leg:
            return True
        return wanted in LEGS[self.tabled_leg].next_positions[self.goal]

    def blocked(self, wanted: int) -> bool:
        """Whether a position moves a leg whose last move has not begun."""
        return self.waits and wanted != self.goal

    @property
    def waits(self) -> bool:
        """Whether the last move has not begun: a position that moves the leg would be blocked."""
        unsettled = self.goal != self.settled or self.starts_at is not None
        return self.alive and unsettled

    @property
    def taken(self) -> int | None:
        """Position that the gates have or move to.

        None of a leg that is off, or whose first gates are not on yet.
        """
        return self.settled if self.alive and self.starts_at is None else None

    def clock(self, now: int, dead: int, rest: int) -> None:
        """Edge `now`, one more each time.

        `dead`: dead time, 1 or more; `rest`: from the end of a move to the next; in clocks.
        """
        if self.starts_at == now:
            leg, self.starts_at = LEGS[self.tabled_leg], None
            # through a position: from there the goal is a move like any other
            self.settled = self.goal if leg.start_through is None else leg.start_through
            before: frozenset[int] = frozenset()
            for step, after in enumerate(leg.start_steps(self.settled % leg.positions)):
                off, on = sorted(before - after), sorted(after - before)
                self.ready_at, before = now + step * dead, after
                self.plan += [(self.ready_at, action) for action in [*(-n for n in off), *on]]
            self.ready_at += rest
        if self.alive and not self.plan and self.goal != self.settled and now >= self.ready_at:
            steps = commutation(self.tabled_leg, self.settled, self.goal)
            self.plan = [(now + i * dead, action) for i, action in enumerate(steps)]
            self.settled = self.goal
            self.ready_at = self.plan[-1][0] + rest
        while self.plan and self.plan[0][0] == now:
            action = self.plan.pop(0)[1]
            self.changed_at = now
            if action > 0:
                self.on.add(action)
            else:
                self.on.remove(-action)

    def resting(self, now: int) -> bool:
        """Whether nothing is under way after edge ``now``."""
        if not self.alive:
            return not self.on
        unsettled = self.goal != self.settled or self.starts_at is not None
        return not unsettled and not self.plan and now + 1 >= self.ready_at


#: Highest values that can be measured; a limit there or above trips with every measurement.
HIGHEST_CURRENT, HIGHEST_VOLTAGE = 2**15 - 1, 2**16 - 1


@dataclass
class Inputs:
    """Inputs of one clock, as the ports of ``gate_guard``; its positions come one clock earlier."""

    # rst, enable, external_trip, driver_fault, upset, measured, start, decided: 0 or 1.
    rst: int = 0
    enable: int = 0
    external_trip: int = 0
    driver_fault: int = 0
    upset: int = 0
    clear: int = 0  # Faults to clear, one bit each in the order of `FAULTS`
    measured: int = 0
    # is_alpha, is_beta: Stator current, LSB of the current's port, signed.
    is_alpha: int = 0
    is_beta: int = 0
    v_dc: int = 0  # dc-link voltage, LSB of its port, unsigned
    start: int = 0
    decided: int = 0
    # position_a, position_b, position_c: Positions that `decided` takes, 0..7 (two-level: bit 0
    # counts alone).
    position_a: int = 0
    position_b: int = 0
    position_c: int = 0
    renew: int = 0  # 1: the settings change after this clock
    # dead_time, minimum_on, minimum_off: Clocks, 12 bits, unsigned.
    dead_time: int = 0
    minimum_on: int = 0
    minimum_off: int = 0
    # decision_limit, watchdog: Clocks, 16 bits, unsigned.
    decision_limit: int = 0
    watchdog: int = 0
    current_limit: int = 0  # LSB of the current's port, unsigned
    # link_high, link_low: LSB of the port of v_dc, unsigned.
    link_high: int = 0
    link_low: int = 0
    # v_n, omega_r: Neutral point and speed, LSB of their ports, signed.
    v_n: int = 0
    # v_ph_a, v_ph_b, v_ph_c: Phase capacitors, LSB of their ports, unsigned; of a converter that
    # has them, as v_n.
    v_ph_a: int = 0
    v_ph_b: int = 0
    v_ph_c: int = 0
    omega_r: int = 0
    # v_ph_high, v_ph_low, v_n_limit, speed_limit: Limits in the same units, unsigned.
    v_ph_high: int = HIGHEST_VOLTAGE - 1
    v_ph_low: int = 0
    v_n_limit: int = HIGHEST_CURRENT - 1
    speed_limit: int = HIGHEST_CURRENT - 1
    # Repetitions of the currents that count as frozen, 0 to 255; 0: any number.
    frozen_limit: int = 0


@dataclass
class Measurement:
    """A measurement on its way through the comparisons, three clocks long."""

    # is_alpha, is_beta: Stator current, LSB of the current's port, signed.
    is_alpha: int
    is_beta: int
    found: set[str]  # Trips found so far
    counts: bool  # Taken while the guard was wanted, under the settings in force

    def compare_current(self, limit: int) -> None:
        """Compare the phase currents. LSB of the current's port, unsigned."""
        # phases times 128, with 111/64 for the root of three
        phases = (
            128 * self.is_alpha,
            -64 * self.is_alpha + 111 * self.is_beta,
            -64 * self.is_alpha - 111 * self.is_beta,
        )
        if max(abs(phase) for phase in phases) > 128 * limit or limit >= HIGHEST_CURRENT:
            self.found.add("over_current")


def _beyond(value: int, limit: int) -> bool:
    """Whether a signed measurement is beyond a limit, or every one is."""
    return abs(value) > limit or limit >= HIGHEST_CURRENT


def measurement_of(i: Inputs, counts: bool, tabled_leg: bool | str = False) -> Measurement | None:
    """What begins its way in one clock, or None; the current is compared later.

    `counts`: it may let the gates come on.
    """
    if not i.measured:
        return None
    found = {"link_high"} if i.v_dc > i.link_high or i.link_high == HIGHEST_VOLTAGE else set()
    if i.v_dc < i.link_low:
        found.add("link_low")
    capacitors = (i.v_ph_a, i.v_ph_b, i.v_ph_c)
    high = i.v_ph_high
    outside = max(capacitors) > high or min(capacitors) < i.v_ph_low or high == HIGHEST_VOLTAGE
    leg = LEGS[tabled_leg]
    if leg.capacitor_nodes and outside:
        found.add("capacitor")
    if leg.neutral_node and _beyond(i.v_n, i.v_n_limit):
        found.add("neutral_point")
    if _beyond(i.omega_r, i.speed_limit):
        found.add("over_speed")
    return Measurement(i.is_alpha, i.is_beta, found, counts)


class GateGuard:
    """The guard of three legs, of a key of `LEGS`; the least dead time is in clocks."""

    def __init__(self, tabled_leg: bool | str, least_dead_time: int) -> None:
        self.tabled_leg = tabled_leg
        self.least = least_dead_time
        self.now = 0
        self.legs = [Leg(tabled_leg) for _ in range(3)]
        self.state = "off"
        self.primed = False
        self.faults: set[str] = set()
        self.off_since = 0
        self.dead = self.rest = TIME_HIGH
        self.begun: tuple[int, int] | None = None
        self.fed: tuple[int, int] = (0, 0)
        self.compared = False
        #: Currents measured last, and how often they have been repeated.
        self.last, self.repeated = (0, 0), 0
        self.same = False
        #: Measured one, two and three clocks ago.
        self.line: list[Measurement | None] = [None, None, None]

    def clock(self, i: Inputs, refused: bool = False) -> None:
        """One rising edge with the values before it.

        `refused`: a leg's interlock has refused a pattern. The reference's legs want none that it
        would.
        """
        self.now += 1
        codes = LEGS[self.tabled_leg].position_of_code if self.tabled_leg else (0, 1) * 4
        now, goals = self.now, [codes[p] for p in (i.position_a, i.position_b, i.position_c)]
        wanted = bool(i.enable and self.primed and not self.faults and not i.rst)
        causes: set[str] = set()
        done = self.line[2]
        counts = wanted and not i.renew
        if wanted:
            causes = set(done.found) if done else set()
            ports = {"external_trip": i.external_trip, "driver": i.driver_fault, "upset": i.upset}
            causes |= {name for name, up in ports.items() if up}
            late = self.begun is not None and now > self.begun[0] + self.begun[1]
            if late and not i.decided:
                causes.add("late")
            if self.state != "off" and now > self.fed[0] + self.fed[1] and not i.decided:
                causes.add("missing")
            if self.state == "active" and i.decided:
                pairs = list(zip(self.legs, goals, strict=True))
                if not all(leg.legal(goal) for leg, goal in pairs):
                    causes.add("illegal_edge")
                if any(leg.blocked(goal) for leg, goal in pairs):
                    causes.add("overrun")

        if refused:
            causes.add("interlock")

        quiet = self.state == "off" and not self.gates
        was, halted = self.state, not wanted or bool(causes) or self.state == "off"
        off_for = min(now - self.off_since - 1, TIME_HIGH)
        rested = wanted and quiet and off_for >= max(self.dead, self.rest)
        arming = rested and not causes
        # gates come on with a decision that finds a measurement compared
        taken = i.decided and (was == "active" or (self.compared and not i.renew))

        for leg, goal in zip(self.legs, goals, strict=True):
            if i.rst or refused:
                leg.kill()
                continue
            if halted:
                leg.stop(now, self.dead)
                continue
            leg.clock(now, self.dead, self.rest)
            if taken:
                leg.goal = goal
                if not leg.alive:
                    leg.alive, leg.starts_at = True, now + 1
                    leg.settled = goal

        if causes:
            self.primed = False
        elif i.enable == 0 and not self.faults:
            self.primed = True
        if i.decided or not wanted:
            self.begun = None
        if wanted and i.start and self.begun is None:
            self.begun = (now, i.decision_limit)
        if i.decided or was == "off":
            self.fed = (now, i.watchdog)
        if quiet:
            if not rested:
                self.dead = max(i.dead_time, self.least)
                self.rest = max(i.minimum_on, i.minimum_off, 1)
        else:
            self.off_since = now
        self.faults = {
            name for n, name in enumerate(FAULTS) if name in self.faults and not i.clear >> n & 1
        } | causes

        if arming:
            self.state = "armed"
        elif was != "off":
            if halted:
                self.state = "off"
            elif taken:
                self.state = "active"
        self.compared = counts and (self.compared or (done is not None and done.counts))
        for one in self.line:
            if one is not None:
                one.counts &= counts
        if self.line[1] is not None:
            self.line[1].compare_current(i.current_limit)
        if self.line[0] is not None:
            again = self.same and was == "active"
            self.repeated = min(self.repeated + 1, 255) if again else 0
            if again and i.frozen_limit and self.repeated >= i.frozen_limit:
                self.line[0].found.add("frozen")
        if i.measured:
            self.same = (i.is_alpha, i.is_beta) == self.last
            self.last = i.is_alpha, i.is_beta
        self.line = [measurement_of(i, counts, self.tabled_leg), *self.line[:2]]
        if i.rst:
            self.compared, self.line = False, [None, None, None]
            self.last, self.repeated = (0, 0), 0
            self.state, self.primed, self.faults, self.begun = "off", False, set(), None
            self.off_since, self.dead, self.rest = now, TIME_HIGH, TIME_HIGH

    @property
    def gates(self) -> int:
        """Gates as the port has them, 8 bits a leg (two-level: 2), phase a lowest.

        Bit n - 1 of a leg is gate n.
        """
        size = len(LEGS[self.tabled_leg].switches)
        return sum(1 << (x * size + gate - 1) for x, leg in enumerate(self.legs) for gate in leg.on)

    @property
    def running(self) -> bool:
        """Whether gates follow decisions: from the edge on that takes the first one."""
        return self.state == "active"

    @property
    def live(self) -> bool:
        """Whether decisions may reach gates, where `enable` is 1.

        Disabled since the last reset or fault, and without a fault.
        """
        return self.primed and not self.faults

    @property
    def resting(self) -> bool:
        """Whether no leg moves or is about to. True as well of a guard that is off."""
        return all(leg.resting(self.now) for leg in self.legs)

    @property
    def taken(self) -> tuple[int | None, ...]:
        """Positions that the gates have or move to."""
        return tuple(leg.taken for leg in self.legs)

    @property
    def waits(self) -> int:
        """Legs whose last move has not begun, as the port has them: bit 2: a, 1: b, 0: c."""
        return sum(leg.waits << (2 - x) for x, leg in enumerate(self.legs))

    @property
    def fault_bits(self) -> int:
        """Faults as the port has them, one bit each in the order of `FAULTS`."""
        return sum(1 << n for n, name in enumerate(FAULTS) if name in self.faults)
