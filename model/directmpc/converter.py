"""Converters as data: a file describes the circuit of a leg, everything else is derived or checked.

A file has switches between nodes, positions with their gates, what each position connects, and what
may follow it (docs/converters.md). The circuit yields the rest: which gates may never be on
together, in which order gates change from one position to the next, and how many turn on. Whatever
the file says besides is checked against the circuit. Potentials are shares of the dc-link voltage.

The phase voltage against the dc-link midpoint is
``v_x = half_dc[s] * v_dc / 2 + neutral[s] * v_n + capacitor[s] * v_ph_x``; the capacitors obey
``dv_n/dt = -sum_x neutral_current[s_x] * i_x / (2 X_dc)`` and
``dv_ph_x/dt = capacitor_current[s_x] * i_x / X_ph`` with i_x > 0 into the load.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import resources
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
Gates = frozenset[int]
Voltage = tuple[float, int, int]
"""Shares of v_dc, v_n and v_ph in a voltage."""

INADMISSIBLE = -1
"""Entry of a transition table where the graph has no edge."""

MAX_NEXT = 4
"""Most positions that may follow one position, staying included; 4**3 = 64 candidates."""

FOLDER = "DIRECTMPC_CONVERTERS"
"""Environment variable: a folder with files of converters of one's own."""

MOST_CONVERTERS = 16
"""A host knows a converter by a number of four bits."""

MAX_POSITIONS = 8
MAX_GATES = 8
MAX_WEIGHT = 5
"""Weights of three phases have to fit in 0..15."""

_TINY = 1e-9


class ConverterError(ValueError):
    """A converter cannot be used; the message names file, entry and what is allowed."""


@dataclass(frozen=True)
class Switch:
    """A switch of a leg, or a diode without one."""

    name: str  # As the file has it
    # first, second: Nodes: a switch that is on conducts from the first to the second one, a diode
    # likewise.
    first: str
    second: str
    rating: float  # What it may block, share of v_dc
    devices: int  # Devices in series
    group: str  # Kind of switch that turn-ons are counted by


@dataclass(frozen=True)
class StopRule:
    """A step of a stop."""

    # on, off: Gates that have to be on and off for it.
    on: Gates
    off: Gates
    change: int  # n: gate n comes on; -n: it goes off


def _table(values: Any) -> IntArray:
    """Make a read-only integer table, so that no user can change it for the others."""
    table = np.array(values, dtype=np.int64)
    table.setflags(write=False)
    return table


@dataclass(frozen=True, eq=False)
class Converter:
    """A converter of three equal legs; p positions a leg, gates counted from 1."""

    # name, title: Of its file; in words.
    name: str
    title: str
    # Whether the checked-in VHDL, and a drive file that names none, are for this one.
    is_default: bool
    rails: Mapping[str, float]  # Potentials of the nodes of the dc link
    output: str  # Node of the load
    # Node whose potential is v_n; None where no position draws current from it.
    neutral_node: str | None
    # Upper and lower node of the phase capacitor, None where there is none.
    capacitor_nodes: tuple[str, str] | None
    capacitor_share: float  # Reference of v_ph, share of v_dc; 0 where there is no capacitor
    # switches, diodes: Gate n belongs to switch n - 1.
    switches: tuple[Switch, ...]
    diodes: tuple[Switch, ...]
    gates: tuple[Gates, ...]  # Gates that are on in each position
    # half_dc, neutral, capacitor: (p,): Coefficients of v_dc/2, v_n and v_ph in the phase voltage.
    half_dc: IntArray
    neutral: IntArray
    capacitor: IntArray
    # What may follow each position, itself included, ascending.
    next_positions: tuple[tuple[int, ...], ...]
    # (2, p, p): Weight of a transition: [phase current negative][from][to].
    transition_weight: IntArray
    stop_first: Gates  # Gates that a stop turns off at once
    # A stop takes the first that fits; where none does, all gates go off.
    stop_rules: tuple[StopRule, ...]
    start_groups: tuple[Gates, ...]  # Which of a position's gates come on in each step of a start
    # Position that every start goes to first and leaves by a transition; None: no detour.
    start_through: int | None

    @property
    def positions(self) -> int:
        """Switch positions of a leg."""
        return len(self.gates)

    @cached_property
    def level(self) -> IntArray:
        """Output level of each position at balanced capacitors, v_dc/4 from the midpoint."""
        return _table(2 * self.half_dc + np.rint(4 * self.capacitor_share) * self.capacitor)

    @property
    def neutral_current(self) -> IntArray:
        """n(s): 1 where the phase current is drawn from the neutral point.

        It is the coefficient of v_n: no power is lost.
        """
        return self.neutral

    @cached_property
    def capacitor_current(self) -> IntArray:
        """c(s): sign with which the phase current charges the phase capacitor.

        It is the negative coefficient of v_ph: no power is lost.
        """
        return _table(-self.capacitor)

    @property
    def half_capacitor(self) -> int:
        """1 where the reference of v_ph is v_dc/2, 0 for v_dc/4 or without a capacitor."""
        return int(self.capacitor_share == 0.5)

    @cached_property
    def position_of_code(self) -> tuple[int, ...]:
        """Position that each code of three bits stands for.

        A code that is no position is as one that differs in a bit, so that whoever never sees it
        needs no logic to tell both.
        """
        low = [min(code, self.positions - 1) for code in range(4)]
        return (*low, *(code if code < self.positions else low[code - 4] for code in range(4, 8)))

    @cached_property
    def has_signed_weights(self) -> bool:
        """Whether the weight of a transition depends on the sign of the current."""
        return not np.array_equal(*self.transition_weight)

    @cached_property
    def next_count(self) -> IntArray:
        """How many positions may follow each position, staying included."""
        return _table([len(row) for row in self.next_positions])

    @cached_property
    def next_table(self) -> IntArray:
        """`next_positions` as a table (p, 4), rows padded with their last entry."""
        return _table([row + row[-1:] * (MAX_NEXT - len(row)) for row in self.next_positions])

    def turn_ons(self, group: str | None = None, devices: int | None = None) -> IntArray:
        """Gates that turn on in each transition [from][to]; `INADMISSIBLE` where there is none.

        Of a group of switches, or with so many devices in series, where given.
        """
        counted = {
            n
            for n, s in enumerate(self.switches, start=1)
            if group in (None, s.group) and devices in (None, s.devices)
        }
        return _table(
            [
                [
                    len((self.gates[t] - self.gates[s]) & counted) if t in row else INADMISSIBLE
                    for t in range(self.positions)
                ]
                for s, row in enumerate(self.next_positions)
            ]
        )

    def candidates(self, s_abc: Sequence[int]) -> list[tuple[int, int, int]]:
        """List the positions that may follow a three-phase position, in the order of enumeration.

        Phase a outermost, each phase ascending: every argmin tie of the controllers goes to the
        earliest. ValueError for a position that the converter has not got.
        """
        positions = [int(s) for s in s_abc]
        if len(positions) != 3 or any(not 0 <= s < self.positions for s in positions):
            raise ValueError(
                f"three switch positions 0..{self.positions - 1} are needed, got {tuple(s_abc)}"
            )
        a, b, c = (self.next_positions[s] for s in positions)
        return list(product(a, b, c))

    def phase_voltages(
        self, s_abc: Sequence[int], v_dc: float, v_n: float, v_ph: Sequence[float]
    ) -> NDArray[np.float64]:
        """Form v_abc against the dc-link midpoint, per unit (Paper A, eq. 2)."""
        s = np.asarray(s_abc, dtype=np.int64)
        link = self.half_dc[s] * (v_dc / 2) + self.neutral[s] * v_n
        return np.asarray(link + self.capacitor[s] * np.asarray(v_ph))

    # ---- circuit ----

    @cached_property
    def _sources(self) -> list[tuple[str, str, Voltage]]:
        """Ideal voltages between nodes: node, other node, how much higher the other is."""
        if self.capacitor_nodes is None:
            return []
        high, low = self.capacitor_nodes
        return [(low, high, (0.0, 0, 1)), (high, low, (0.0, 0, -1))]

    def _volts(self, voltage: Voltage) -> float:
        """A voltage at balanced capacitors, share of v_dc."""
        return voltage[0] + self.capacitor_share * voltage[2]

    def output_voltages(self, gates: Iterable[int]) -> tuple[Voltage | None, Voltage | None] | None:
        """Output voltage for i > 0 and i < 0, with ideal switches.

        None where a source is shorted; an entry is None where the current has no way. Current out
        of the output takes the path of highest potential that conducts, current into it the one of
        lowest.
        """
        on = frozenset(gates)
        if on not in self._outputs:
            self._outputs[on] = self._solve(on)
        return self._outputs[on]

    @cached_property
    def _outputs(self) -> dict[Gates, tuple[Voltage | None, Voltage | None] | None]:
        return {}

    def _solve(self, gates: Gates) -> tuple[Voltage | None, Voltage | None] | None:
        conducts = [(d.first, d.second) for d in self.diodes]
        conducts += [(s.second, s.first) for s in self.switches]
        conducts += [(self.switches[g - 1].first, self.switches[g - 1].second) for g in gates]
        found: list[Voltage | None] = []
        for sign in (1, -1):
            edges = [(a, b, (0.0, 0, 0)) if sign > 0 else (b, a, (0.0, 0, 0)) for a, b in conducts]
            edges += self._sources
            reached: dict[str, Voltage] = {
                node: (volts, int(node == self.neutral_node), 0)
                for node, volts in self.rails.items()
            }
            for _ in range(2 * len(edges)):
                moved = False
                for a, b, (dc, n, ph) in edges:
                    if a not in reached:
                        continue
                    at = reached[a]
                    ahead = (at[0] + dc, at[1] + n, at[2] + ph)
                    before = reached.get(b)
                    gain = 1.0 if before is None else self._volts(ahead) - self._volts(before)
                    if before is None or sign * gain > _TINY:
                        if b in self.rails:
                            return None
                        reached[b], moved = ahead, True
                if not moved:
                    break
            else:
                return None
            found.append(reached.get(self.output))
        return found[0], found[1]

    def _possible(self, gates: Gates) -> bool:
        """Whether the nodes can have potentials at which no source is shorted and no rating passed.

        Of each pair (a, b, w): V(b) <= V(a) + w. A circle of negative length contradicts itself.
        """
        limits: list[tuple[str, str, float]] = []
        nodes = list(self.rails)
        for high, low in combinations(nodes, 2):
            volts = self.rails[high] - self.rails[low]
            limits += [(low, high, volts), (high, low, -volts)]
        for a, b, voltage in self._sources:
            limits.append((a, b, self._volts(voltage)))
        for n, s in enumerate(self.switches, start=1):
            limits += [(s.first, s.second, 0.0)]
            limits += [(s.second, s.first, 0.0 if n in gates else s.rating)]
        for d in self.diodes:
            limits += [(d.second, d.first, 0.0), (d.first, d.second, d.rating)]
        length = {node: 0.0 for a, b, _ in limits for node in (a, b)}
        for _ in range(len(length) + 1):
            moved = False
            for a, b, w in limits:
                if length[b] > length[a] + w + _TINY:
                    length[b], moved = length[a] + w, True
            if not moved:
                return True
        return False

    @cached_property
    def forbidden(self) -> tuple[Gates, ...]:
        """Smallest sets of gates that may never be on together.

        Each shorts a source, or puts more than its rating on some device whatever the load does; in
        the order of their size.
        """
        found: list[Gates] = []
        every = range(1, len(self.switches) + 1)
        for size in every:
            for some in combinations(every, size):
                gates = frozenset(some)
                if not any(f <= gates for f in found) and not self._possible(gates):
                    found.append(gates)
        return tuple(found)

    def is_forbidden(self, gates: Iterable[int]) -> bool:
        """Whether these gates may never be on together."""
        on = frozenset(gates)
        return any(f <= on for f in self.forbidden)

    # ---- how gates change ----

    def commutation(self, origin: int, goal: int) -> tuple[int, ...]:
        """Single-gate actions from one position to the next.

        n: gate n on, -n: gate n off. ValueError if no order is clean. Gates that leave go off
        before others come on wherever that is clean. An order is clean if it passes no forbidden
        pattern, the current has a way for either sign, and the output makes one step, or none where
        both positions have the same voltage.
        """
        key = (origin, goal)
        if key not in self._orders:
            off = sorted(self.gates[origin] - self.gates[goal])
            on = sorted(self.gates[goal] - self.gates[origin])
            actions = [*(-gate for gate in off), *on]
            found = next(self._clean(origin, goal, self.gates[origin], actions, [0, 0]), None)
            if found is None:
                raise ValueError(f"no order of single gates from {origin} to {goal} is clean")
            self._orders[key] = found
        return self._orders[key]

    @cached_property
    def _orders(self) -> dict[tuple[int, int], tuple[int, ...]]:
        return {}

    def _clean(
        self, origin: int, goal: int, on: Gates, left: list[int], steps: list[int]
    ) -> Iterator[tuple[int, ...]]:
        """Clean orders of what is left; `steps`: whether the output has made its step, by sign."""
        if not left:
            yield ()
            return
        ends = (self._voltage(origin), self._voltage(goal))
        for n, action in enumerate(left):
            after = on | {action} if action > 0 else on - {-action}
            if self.is_forbidden(after):
                continue
            outputs = self.output_voltages(after)
            if outputs is None:
                continue
            now = list(steps)
            for sign, voltage in enumerate(outputs):
                if voltage == ends[1]:
                    now[sign] = 1
                elif voltage != ends[0] or now[sign]:
                    break
            else:
                rest = [*left[:n], *left[n + 1 :]]
                for behind in self._clean(origin, goal, after, rest, now):
                    yield (action, *behind)

    def _voltage(self, s: int) -> Voltage:
        """Output voltage of a position."""
        return 0.5 * int(self.half_dc[s]), int(self.neutral[s]), int(self.capacitor[s])

    def stop_step(self, on: Gates) -> Gates:
        """Gates that the next step of a stop leaves on."""
        for rule in self.stop_rules:
            if rule.on <= on and not rule.off & on:
                return on | {rule.change} if rule.change > 0 else on - {-rule.change}
        return frozenset()

    def start_steps(self, position: int) -> tuple[Gates, ...]:
        """Gates that are on after each step of a start; the last ones are the position's."""
        first = position if self.start_through is None else self.start_through
        steps = [self.gates[first] & group for group in self.start_groups]
        steps = [frozenset[int]().union(*steps[: n + 1]) for n in range(len(steps))]
        for action in self.commutation(first, position):
            steps.append(steps[-1] | {action} if action > 0 else steps[-1] - {-action})
        return tuple(steps)

    def patterns(self) -> Iterator[tuple[str, Gates]]:
        """Patterns of gates that positions, transitions and starts pass, and where they occur."""
        for s, gates in enumerate(self.gates):
            yield f"position {s}", gates
            for t in self.next_positions[s]:
                on = gates
                for action in self.commutation(s, t):
                    on = on | {action} if action > 0 else on - {-action}
                    yield f"the transition from {s} to {t}", on
            for on in self.start_steps(s):
                yield f"the start of position {s}", on

    @cached_property
    def stop_steps(self) -> int:
        """Most steps of a stop, a wait for the last action to be a dead time old included."""
        most = 1
        for _, gates in self.patterns():
            on, steps = gates, 0 if gates & self.stop_first else 1
            while on:
                on, steps = self.stop_step(on), steps + 1
            most = max(most, steps)
        return most

    @property
    def logical_devices(self) -> int:
        """Switches of three legs; devices in series count once."""
        return 3 * len(self.switches)

    @property
    def physical_devices(self) -> int:
        """Devices of three legs; each device in series counts."""
        return 3 * sum(s.devices for s in self.switches)


class _Reader:
    """Takes entries of a file one by one; whatever is wrong becomes a `ConverterError`."""

    def __init__(self, file: str) -> None:
        self.file = file

    def refuse(self, entry: str, problem: str) -> ConverterError:
        """Error that names file and entry."""
        return ConverterError(f"{self.file}: {entry}: {problem}")

    def table(self, value: Any, entry: str, needed: str, optional: str = "") -> dict[str, Any]:
        """A table with these keys and no others."""
        may = [*needed.split(), *optional.split()]
        if not isinstance(value, dict):
            raise self.refuse(entry, f"a table with the keys {', '.join(may)} is needed")
        where = f"{entry}." if entry else ""
        for key in value:
            if key not in may:
                raise self.refuse(f"{where}{key}", f"unknown key; it may be {', '.join(may)}")
        for key in needed.split():
            if key not in value:
                raise self.refuse(f"{where}{key}", "missing")
        return value

    def text(self, value: Any, entry: str) -> str:
        """A text that is not empty."""
        if not isinstance(value, str) or not value.strip():
            raise self.refuse(entry, f"got {value!r}; it must be a text")
        return value

    def number(self, value: Any, entry: str, low: float, high: float) -> float:
        """A number in a range."""
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if not good or not low <= value <= high:
            raise self.refuse(entry, f"got {value!r}; it must be a number from {low:g} to {high:g}")
        return float(value)

    def integer(self, value: Any, entry: str, low: int, high: int) -> int:
        """An integer in a range."""
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise self.refuse(entry, f"got {value!r}; it must be an integer from {low} to {high}")
        return value

    def listed(self, value: Any, entry: str, low: int, high: int) -> tuple[int, ...]:
        """Different integers of a range."""
        if not isinstance(value, list):
            raise self.refuse(entry, f"got {value!r}; a list of integers is needed")
        found = tuple(self.integer(v, f"{entry}[{n}]", low, high) for n, v in enumerate(value))
        if len(set(found)) != len(found):
            raise self.refuse(entry, f"got {value!r}; an entry occurs twice")
        return found


def _switches(read: _Reader, value: Any, entry: str) -> tuple[Switch, ...]:
    """Switches or diodes of a file."""
    if not isinstance(value, dict):
        raise read.refuse(entry, "a table with an entry for each is needed")
    found = []
    for place, (name, given) in enumerate(value.items(), start=1):
        here = f"{entry}.{name}"
        if entry == "switches" and name != f"S{place}":
            raise read.refuse(here, f"switches are S1, S2, ... in turn; S{place} is expected here")
        keys = read.table(given, here, "nodes rating", "devices group")
        nodes = keys["nodes"]
        if not isinstance(nodes, list) or len(nodes) != 2 or nodes[0] == nodes[1]:
            raise read.refuse(f"{here}.nodes", f"got {nodes!r}; two different nodes are needed")
        first, second = (read.text(node, f"{here}.nodes") for node in nodes)
        found.append(
            Switch(
                name,
                first,
                second,
                read.number(keys["rating"], f"{here}.rating", 0.01, 1.0),
                read.integer(keys.get("devices", 1), f"{here}.devices", 1, 16),
                read.text(keys.get("group", "all"), f"{here}.group"),
            )
        )
    return tuple(found)


def _weights(
    read: _Reader, rows: list[dict[str, Any]], nexts: list[tuple[int, ...]], gates: list[Gates]
) -> IntArray:
    """Weights of transitions; the turn-ons where a file has none."""
    count = len(rows)
    found = np.full((2, count, count), INADMISSIBLE, dtype=np.int64)
    for s, (row, following) in enumerate(zip(rows, nexts, strict=True)):
        for t in following:
            found[:, s, t] = len(gates[t] - gates[s])
        positive = row.get("weights")
        given = {"weights": positive, "weights_negative": row.get("weights_negative", positive)}
        for sign, (key, values) in enumerate(given.items()):
            entry = f"positions[{s}].{key}"
            if values is None:
                continue
            if not isinstance(values, list) or len(values) != len(following):
                raise read.refuse(entry, f"got {values!r}; each entry of next needs a weight")
            for n, (t, weight) in enumerate(zip(following, values, strict=True)):
                low, high = (0, 0) if t == s else (1, MAX_WEIGHT)
                found[sign, s, t] = read.integer(weight, f"{entry}[{n}]", low, high)
    found.setflags(write=False)
    return found


def _check_nodes(read: _Reader, leg: Converter) -> None:
    """Every node has a use, every connection exists."""
    ends = [node for s in (*leg.switches, *leg.diodes) for node in (s.first, s.second)]
    for node in leg.rails:
        if node not in ends:
            raise read.refuse(f"rails.{node}", "no switch leads to this node")
    if leg.output not in ends or leg.output in leg.rails:
        raise read.refuse("output", f'got "{leg.output}"; a node of switches, no rail, is needed')
    for node in leg.capacitor_nodes or ():
        if node not in ends or node in leg.rails:
            raise read.refuse("capacitor", f'got "{node}"; a node of switches, no rail, is needed')
    known = {*leg.rails, leg.output, *(leg.capacitor_nodes or ())}
    for s in (*leg.switches, *leg.diodes):
        for node in (s.first, s.second):
            if node not in known and ends.count(node) < 2:
                entry = f"{'diodes' if s in leg.diodes else 'switches'}.{s.name}.nodes"
                raise read.refuse(entry, f'nothing else is connected to "{node}"')


def _in_words(voltage: Voltage) -> str:
    return f"v_dc = {voltage[0]:g}, v_n = {voltage[1]}, v_ph = {voltage[2]}"


def _check_positions(read: _Reader, leg: Converter, charges: list[int]) -> None:
    """What a position connects follows from the circuit."""
    for s, gates in enumerate(leg.gates):
        entry = f"positions[{s}]"
        if leg.is_forbidden(gates):
            raise read.refuse(
                f"{entry}.gates", f"{sorted(gates)} short a source or overload a device"
            )
        outputs = leg.output_voltages(gates)
        if outputs is None or None in outputs or outputs[0] != outputs[1]:
            raise read.refuse(
                f"{entry}.gates", f"with {sorted(gates)} on the current's sign sets the voltage"
            )
        stated = leg._voltage(s)
        if outputs[0] != stated:
            found = "" if outputs[0] is None else _in_words(outputs[0])
            raise read.refuse(
                entry, f"got {_in_words(stated)}; its gates {sorted(gates)} make {found}"
            )
        if charges[s] != -leg.capacitor[s]:
            raise read.refuse(
                f"{entry}.charge",
                f"got {charges[s]}; with v_ph = {leg.capacitor[s]} it is {-leg.capacitor[s]}",
            )
    if len(set(leg.gates)) != len(leg.gates):
        raise read.refuse("positions", "two positions have the same gates")
    if leg.capacitor_nodes is not None and not {-1, 1} <= set(leg.capacitor.tolist()):
        raise read.refuse("positions", "they have to charge the capacitor and to discharge it")
    if leg.neutral_node is not None and not leg.neutral.any():
        raise read.refuse("neutral", "no position connects the phase to it; leave the key out")


def _check_graph(read: _Reader, leg: Converter) -> None:
    """The graph can be walked, each of its edges by the gates."""
    for s, following in enumerate(leg.next_positions):
        entry = f"positions[{s}].next"
        if s not in following or list(following) != sorted(following):
            raise read.refuse(entry, f"got {list(following)}; {s} itself, ascending, is needed too")
        for t in following:
            if s not in leg.next_positions[t]:
                raise read.refuse(entry, f"{t} may follow {s}, but {s} may not follow {t}")
            try:
                leg.commutation(s, t)
            except ValueError:
                raise read.refuse(
                    entry,
                    f"{t} cannot follow {s}: no order of single gates keeps clear of short "
                    "circuits, gives the current a way for either sign and makes one step",
                ) from None
    reached, edge = {0}, [0]
    while edge:
        edge = [t for s in edge for t in leg.next_positions[s] if t not in reached]
        reached.update(edge)
    for s in range(leg.positions):
        if s not in reached:
            raise read.refuse(f"positions[{s}].next", f"position {s} cannot be reached from 0")


def _check_stops(read: _Reader, leg: Converter) -> None:
    """Stops and starts end, and pass no forbidden pattern."""
    every = frozenset(range(1, len(leg.switches) + 1))
    if sorted(gate for group in leg.start_groups for gate in group) != sorted(every):
        raise read.refuse("start.groups", f"each of the gates 1 to {len(every)} is needed once")
    if leg.start_through is not None and len(leg.next_positions[leg.start_through]) < leg.positions:
        raise read.refuse("start.through", f"not every position may follow {leg.start_through}")
    for where, gates in leg.patterns():
        if leg.is_forbidden(gates):
            raise read.refuse("start.groups", f"{where} passes the gates {sorted(gates)}")
        on, seen = gates, set()
        while on:
            if on in seen:
                raise read.refuse("stop.rules", f"a stop from {where} does not end")
            seen.add(on)
            on = leg.stop_step(on)
            if leg.is_forbidden(on):
                raise read.refuse("stop.rules", f"a stop from {where} passes {sorted(on)}")
        if gates & leg.stop_first and not leg.stop_step(gates) < gates:
            raise read.refuse("stop.first", f"a stop from {where} begins with another gate")


def _built(read: _Reader, name: str, data: dict[str, Any]) -> Converter:
    """Converter of a file's entries."""
    keys = read.table(
        data,
        "",
        "title output rails positions switches stop start",
        "neutral capacitor diodes default",
    )
    if keys.get("default", True) is not True:
        raise read.refuse("default", f"got {keys['default']!r}; it must be true, or left out")
    rails = keys["rails"]
    if not isinstance(rails, dict) or len(rails) < 2:
        raise read.refuse("rails", "a table of nodes and their potentials is needed")
    rails = {node: read.number(v, f"rails.{node}", -0.5, 0.5) for node, v in rails.items()}
    neutral = keys.get("neutral")
    if neutral is not None and rails.get(neutral) != 0.0:
        raise read.refuse("neutral", f"got {neutral!r}; a node of rails with the potential 0")
    if sorted(v for node, v in rails.items() if node != neutral) != [-0.5, 0.5]:
        raise read.refuse("rails", "one node at 0.5, one at -0.5 and, as neutral, one at 0 at most")
    nodes, share = None, 0.0
    if "capacitor" in keys:
        given = read.table(keys["capacitor"], "capacitor", "positive negative share")
        nodes = (
            read.text(given["positive"], "capacitor.positive"),
            read.text(given["negative"], "capacitor.negative"),
        )
        share = read.number(given["share"], "capacitor.share", 0.25, 0.5)
        if share not in (0.25, 0.5):
            raise read.refuse("capacitor.share", f"got {share:g}; it must be 0.25 or 0.5")
    switches = _switches(read, keys["switches"], "switches")
    count = len(switches)
    if not 2 <= count <= MAX_GATES:
        raise read.refuse("switches", f"got {count}; 2 to {MAX_GATES} are needed")
    rows = keys["positions"]
    if not isinstance(rows, list) or not 2 <= len(rows) <= MAX_POSITIONS:
        raise read.refuse("positions", f"a list of 2 to {MAX_POSITIONS} positions is needed")
    gates, nexts, charges = [], [], []
    voltages = np.zeros((3, len(rows)), dtype=np.int64)
    for s, row in enumerate(rows):
        here = f"positions[{s}]"
        read.table(row, here, "gates v_dc v_n v_ph charge next", "weights weights_negative")
        gates.append(frozenset(read.listed(row["gates"], f"{here}.gates", 1, count)))
        nexts.append(read.listed(row["next"], f"{here}.next", 0, len(rows) - 1))
        if len(nexts[-1]) > MAX_NEXT:
            raise read.refuse(
                f"{here}.next", f"got {len(nexts[-1])}; {MAX_NEXT} may follow at most"
            )
        half = 2 * read.number(row["v_dc"], f"{here}.v_dc", -0.5, 0.5)
        if half not in (-1, 0, 1):
            raise read.refuse(f"{here}.v_dc", f"got {row['v_dc']}; it must be -0.5, 0 or 0.5")
        voltages[0, s] = half
        voltages[1, s] = read.integer(row["v_n"], f"{here}.v_n", 0, int(neutral is not None))
        most = int(nodes is not None)
        voltages[2, s] = read.integer(row["v_ph"], f"{here}.v_ph", -most, most)
        charges.append(read.integer(row["charge"], f"{here}.charge", -most, most))
    stop = read.table(keys["stop"], "stop", "first rules")
    rules = []
    for n, rule in enumerate(stop["rules"]):
        here = f"stop.rules[{n}]"
        read.table(rule, here, "on change", "off")
        change = read.integer(rule["change"], f"{here}.change", -count, count)
        on = frozenset(read.listed(rule["on"], f"{here}.on", 1, count))
        off = frozenset(read.listed(rule.get("off", []), f"{here}.off", 1, count))
        if not (-change in on or change in off):
            raise read.refuse(f"{here}.change", f"got {change}; on or off has to name the gate")
        rules.append(StopRule(on, off, change))
    start = read.table(keys["start"], "start", "groups", "through")
    through = start.get("through")
    if through is not None:
        read.integer(through, "start.through", 0, len(rows) - 1)
    leg = Converter(
        name=name,
        title=read.text(keys["title"], "title"),
        is_default="default" in keys,
        rails=rails,
        output=read.text(keys["output"], "output"),
        neutral_node=neutral,
        capacitor_nodes=nodes,
        capacitor_share=share,
        switches=switches,
        diodes=_switches(read, keys.get("diodes", {}), "diodes"),
        gates=tuple(gates),
        half_dc=_table(voltages[0]),
        neutral=_table(voltages[1]),
        capacitor=_table(voltages[2]),
        next_positions=tuple(nexts),
        transition_weight=_weights(read, rows, nexts, gates),
        stop_first=frozenset(read.listed(stop["first"], "stop.first", 1, count)),
        stop_rules=tuple(rules),
        start_groups=tuple(
            frozenset(read.listed(group, f"start.groups[{n}]", 1, count))
            for n, group in enumerate(start["groups"])
        ),
        start_through=through,
    )
    _check_nodes(read, leg)
    _check_positions(read, leg, charges)
    _check_graph(read, leg)
    _check_stops(read, leg)
    return leg


def read_converter(path: str | os.PathLike[str]) -> Converter:
    """Read a converter (docs/converters.md), checked against its circuit.

    ConverterError names file and entry where one is missing, unknown, out of range or at odds with
    the circuit.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConverterError(f"{path}: cannot be read ({error})") from None
    return _parsed(str(path), file.stem, text)


def _parsed(file: str, name: str, text: str) -> Converter:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConverterError(f"{file}: not a TOML file ({error})") from None
    return _built(_Reader(file), name, data)


@cache
def shipped() -> tuple[str, ...]:
    """Names of the converters that come with the package, ascending."""
    folder = resources.files("directmpc") / "converters"
    return tuple(
        sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))
    )


@cache
def _own() -> dict[str, Path]:
    """Files of one's own: those in the folder that the environment variable `FOLDER` names."""
    folder = os.environ.get(FOLDER, "")
    files = {path.stem: path for path in sorted(Path(folder).glob("*.toml"))} if folder else {}
    if folder and not files:
        raise ConverterError(f"{FOLDER}: {folder}: no folder with files of converters (*.toml)")
    for name in files.keys() & set(shipped()):
        raise ConverterError(f"{files[name]}: {name} ships with directmpc; take another name")
    if len(files) > MOST_CONVERTERS - len(shipped()):
        raise ConverterError(f"{FOLDER}: {folder}: more than {MOST_CONVERTERS} converters in all")
    return files


def names() -> tuple[str, ...]:
    """Names of all converters: those that are shipped, then those of one's own."""
    return (*shipped(), *_own())


@cache
def load(name: str) -> Converter:
    """Load one of `names`, checked against its circuit; ConverterError if there is none."""
    if name not in names():
        raise ConverterError(f'converter: got "{name}"; it must be one of {", ".join(names())}')
    if name in _own():
        return read_converter(_own()[name])
    file = resources.files("directmpc") / "converters" / f"{name}.toml"
    return _parsed(file.name, name, file.read_text(encoding="utf-8"))
