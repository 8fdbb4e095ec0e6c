"""Cocotb side of ``test_state_observer``: steps and scalings against the twins."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mpdcc import capacitor_observer as filters
from directmpc.mpdcc import leakage, observer
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX, ROOM, registers
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")
FLUX = ("psir_alpha", "psir_beta")
SIGNED = {"is_alpha", "is_beta", "v_n", "omega_r", *FLUX}
VOLTAGES = ("used_n", "used_a", "used_b", "used_c")
#: Clocks from the start: to filters_valid, to valid, to leakage_valid, in which it is busy.
FILTERS = clocks_of("state_observer", "filters")
FILTERS_BUSY = clocks_of("state_observer", "filters busy")
VALID = clocks_of("state_observer", "flux")
BUSY = clocks_of("state_observer", "flux busy")
LEAKAGE = clocks_of("state_observer", "leakage")
LATER = clocks_of("state_observer", "filtered") - VALID
SCALING = clocks_of("state_observer", "scaling")
#: Clocks from the start on in which measurements hold still: with flux alone, with filters.
MEASURED, FILTERED = 12, 20
PLACES = [INDEX[name] for name in CURRENT_SLOPES]
SLOPES = len(CURRENT_SLOPES)
HIGH = 2**15 - 1
MOST = 2**17 - 1


@dataclass
class Step:
    """What a step is given."""

    m: np.ndarray  # in the order of PORTS
    s: np.ndarray
    flux: tuple[int, int] = (0, 0)  # that the core gets, where the estimate is not used
    parts: str = "flux"  # of "filters flux leakage"
    observed: int = 0
    frozen: int = 0

    def has(self, part: str) -> int:
        """Whether the step has a part."""
        return int(part in self.parts.split())


class Bench:
    """The observers beside their twins, step by step."""

    def __init__(self, dut, seed: int, pauses: tuple[int, ...] = (0, 0, 1, 5)) -> None:
        self.dut, self.rng, self.pauses = dut, random.Random(seed), pauses
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.count = 0
        self.f = dict.fromkeys((*filters.COEFFICIENTS, *filters.SHIFTS), 0)
        self.o = dict.fromkeys(observer.COEFFICIENTS, 0)
        self.c = dict.fromkeys(leakage.COEFFICIENTS, 0)
        self.options = arguments()
        self.forgotten()
        for name in ("start", "scale", "forget_filters", "forget_leakage", "frozen", "observed"):
            getattr(dut, name).value = 0
        for name in ("filters", "flux", "leakage"):
            getattr(dut, f"with_{name}").value = 0
        dut.given.value = 0

    def forgotten(self) -> None:
        """The twins begin anew."""
        self.voltages = np.zeros(filters.STATE_WORDS, dtype=np.int64)
        self.state = np.zeros(observer.STATE_WORDS, dtype=np.int64)
        self.ratio = leakage.first()

    @property
    def theta(self) -> int:
        """The twin's."""
        return int(self.ratio[0]) >> leakage.GUARD

    async def reset(self, part: str = "") -> None:
        """All begin anew, or one part."""
        if part:
            port = getattr(self.dut, f"forget_{part}")
            port.value = 1
            await self.clock.tick()
            port.value = 0
            if part == "filters":
                self.voltages[:] = 0
            else:
                self.ratio = leakage.first()
        else:
            self.parameters()
            self.put(any_step(self.rng, "flux"))
            await self.clock.reset(2)
            self.forgotten()
        await self.clock.settle()
        if self.options["leakage"]:
            self.board.check("theta", number(self.dut.theta), self.theta, "reset")
        self.board.cover(f"reset {part}".strip())

    def put(self, step: Step) -> None:
        """Measurements and positions on the ports."""
        for name, value in zip((*PORTS, *FLUX), (*step.m, *step.flux), strict=True):
            value = int(value)
            getattr(self.dut, name).value = bits(value, 16) if name in SIGNED else value
        for name, value in zip("abc", step.s, strict=True):
            getattr(self.dut, f"s_{name}").value = int(value)

    def parameters(self) -> None:
        """Coefficients and gains on the ports."""
        for name in filters.COEFFICIENTS:
            getattr(self.dut, f"f_{name}").value = bits(self.f[name], 16)
        for name in filters.SHIFTS:
            getattr(self.dut, f"f_{name}").value = self.f[name]
        for name, value in self.o.items():
            getattr(self.dut, f"o_{name}").value = bits(value, 18)
        for name, value in self.c.items():
            getattr(self.dut, f"l_{name}").value = bits(value, 18)

    def twins(self, step: Step) -> dict[str, tuple[int, ...]]:
        """What each part makes of the step."""
        found: dict[str, tuple[int, ...]] = {}
        m = step.m.copy()
        if step.has("filters"):
            *volts, over = filters.step_words(
                filters.array(self.f), self.voltages, m[:6], step.s, 0
            )
            m[2:6] = volts
            found["filters"] = (*map(int, volts), int(over))
        if step.has("flux"):
            v = observer.voltages(m, step.s)[:2]
            *flux, over = observer.step_words(observer.array(self.o), self.state, m, step.s)
            found["flux"] = (*map(int, flux), int(over))
            if step.has("leakage"):
                flux = flux if step.observed else step.flux
                known = np.array([m[0], m[1], *flux, m[7]], dtype=np.int64)
                theta, over = leakage.step_voltages(
                    leakage.array(self.c), self.ratio, known, v, step.frozen
                )
                found["leakage"] = int(theta), int(over)
        # the current at k-1 is that of the step before, whatever parts that had
        for state, first in ((self.voltages, 4), (self.state, 4), (self.ratio, 1)):
            state[first : first + 2] = m[:2]
        return found

    async def step(self, step: Step) -> dict[str, tuple[int, ...]]:
        """One step, all its clocks; what it found."""
        dut, board, rng = self.dut, self.board, self.rng
        self.count += 1
        label = f"step {self.count}, {step.parts}"
        found = self.twins(step)
        self.parameters()
        self.put(step)
        for part in ("filters", "flux", "leakage"):
            getattr(dut, f"with_{part}").value = step.has(part)
        dut.observed.value, dut.frozen.value = step.observed, step.frozen
        dut.start.value, dut.scale.value = 1, rng.randrange(2) * self.options["leakage"]
        more = LATER * step.has("filters")
        flux_at, end = VALID + more, BUSY + more
        if not step.has("flux"):
            flux_at, end = 0, FILTERS_BUSY
        leakage_at = (LEAKAGE + more) * step.has("leakage")
        end = leakage_at - 1 if leakage_at else end
        filters_at = FILTERS * step.has("filters")
        held = 1 + (FILTERED if step.has("filters") else MEASURED)
        await self.clock.tick()
        pause = rng.choice(self.pauses)
        for count in range(1, end + 2 + pause):
            inside = count <= end
            dut.start.value = rng.randrange(2) * inside
            dut.scale.value = rng.randrange(2) * inside
            if count >= held:
                other = any_step(rng, step.parts)
                if flux_at <= count < flux_at + 3 and step.observed:
                    other.flux = (found["flux"][0], found["flux"][1])
                self.put(other)
                dut.observed.value = rng.randrange(2)
                dut.with_leakage.value, dut.with_flux.value = rng.randrange(2), rng.randrange(2)
            elif step.observed and step.has("flux"):
                self.put(Step(step.m, step.s, (word(rng, 16), word(rng, 16))))
            await self.clock.settle()
            where = f"{label}, {count}"
            board.check("busy", number(dut.busy), int(inside), where)
            if self.options["leakage"]:
                board.check("scaling", number(dut.scaling), 0, where)
            for name, at in (("filters_valid", filters_at), ("valid", flux_at),
                             ("leakage_valid", leakage_at)):  # fmt: skip
                board.check(name, number(getattr(dut, name)), int(count == at > 0), where)
            if filters_at and count >= filters_at:
                got = (
                    signed(number(dut.used_n), 16),
                    *(number(getattr(dut, name)) for name in VOLTAGES[1:]),
                    number(dut.filters_saturated),
                )
                board.check("voltages", got, found["filters"], where)
            if flux_at and count >= flux_at:
                got = (
                    signed(number(dut.flux_alpha), 16),
                    signed(number(dut.flux_beta), 16),
                    number(dut.saturated),
                )
                board.check("estimate", got, found["flux"], where)
            if leakage_at and count >= leakage_at:
                got = number(dut.theta), number(dut.leakage_saturated)
                board.check("theta", got, found["leakage"], where)
            await self.clock.edge()
        return found

    async def scale(self, given: np.ndarray) -> int:
        """One scaling; whether a coefficient was clipped."""
        dut, board, rng = self.dut, self.board, self.rng
        row = np.zeros(len(INDEX), dtype=np.int64)
        row[PLACES] = given
        values = row.copy()
        clipped = leakage.scaled(self.theta, row, values)
        label = f"scaling behind step {self.count}"
        dut.given.value = sum(bits(int(w), 16) << 16 * n for n, w in enumerate(given))
        dut.start.value, dut.scale.value = 0, 1
        await self.clock.tick()
        for count in range(1, SCALING + 1):
            dut.start.value, dut.scale.value = rng.randrange(2), rng.randrange(2)
            await self.clock.settle()
            board.check("busy", number(dut.busy), 1, f"{label}, {count}")
            board.check("scaling", number(dut.scaling), 1, f"{label}, {count}")
            for name in ("filters_valid", "valid", "leakage_valid"):
                board.check(name, number(getattr(dut, name)), 0, f"{label}, {count}")
            await self.clock.edge()
        dut.start.value, dut.scale.value = 0, 0
        dut.given.value = rng.getrandbits(16 * SLOPES)
        await self.clock.settle()
        board.check("busy", number(dut.busy), 0, label)
        got = number(dut.scaled)
        words = [signed(got >> 16 * n & 0xFFFF, 16) for n in range(SLOPES)]
        board.check("scaled", words, values[PLACES].tolist(), label)
        board.check("clipped", number(dut.clipped), int(clipped), label)
        board.check("theta", number(dut.theta), self.theta, label)
        return int(clipped)


def any_step(rng: random.Random, parts: str) -> Step:
    """Words of any content, corners often."""
    m = np.array([word(rng, 16, signed=name in SIGNED) for name in PORTS], dtype=np.int64)
    return Step(
        m, any_positions(rng), (word(rng, 16), word(rng, 16)), parts, rng.randrange(2),
        int(rng.random() < 0.2),
    )  # fmt: skip


def corners(rng: random.Random, parts: str) -> Step:
    """Every word at one of its ends."""
    ends = [(-HIGH - 1, HIGH) if name in SIGNED else (0, 2 * HIGH + 1) for name in PORTS]
    m = np.array([rng.choice(pair) for pair in ends], dtype=np.int64)
    flux = (rng.choice((-HIGH - 1, HIGH)), rng.choice((-HIGH - 1, HIGH)))
    return Step(m, any_positions(rng), flux, parts)


def any_positions(rng: random.Random) -> np.ndarray:
    """Positions of any kind."""
    return np.array([rng.randrange(8) for _ in range(3)])


def any_filters(rng: random.Random) -> dict[str, int]:
    """Coefficients of any content, gains of any kind."""
    c = {name: word(rng, 16) >> rng.choice([0, 0, 3, 8]) for name in filters.COEFFICIENTS}
    return c | {name: rng.randrange(8) for name in filters.SHIFTS}


def any_leakage(rng: random.Random) -> dict[str, int]:
    """Coefficients of any content."""
    return {name: word(rng, 18) >> rng.choice([0, 0, 3, 6]) for name in leakage.COEFFICIENTS}


def any_slopes(rng: random.Random) -> np.ndarray:
    """Coefficients of the core of any content."""
    return np.array([word(rng, 16) for _ in range(SLOPES)], dtype=np.int64)


def machine(rng: random.Random, n: int, c: dict[str, int], i: np.ndarray) -> Step:
    """A turning flux, voltages with noise, and the current of a machine with other leakage."""
    flux = 9000 * np.exp(0.0157j * n)
    s = any_positions(rng)
    m = np.array([0, 0, rng.gauss(0, 160)] + [16_000 + rng.gauss(0, 80) for _ in range(3)]
                 + [32_000, 15_900], dtype=np.int64)  # fmt: skip
    v = observer.voltages(m, s)[:2]
    angle = m[7] * c["emf"] / 2**16
    phi = np.array([v[0] * c["voltage_alpha"] + flux.imag * angle,
                    v[1] * c["voltage_beta"] - flux.real * angle])  # fmt: skip
    i += 1.3 * phi / 2**16
    i *= 0.98
    m[:2] = np.clip([part + rng.gauss(0, 20) for part in i], -HIGH, HIGH)
    return Step(m, s, (int(flux.real), int(flux.imag)))


@cocotb.test(skip=bool(arguments()["alone"]))
async def steps(dut) -> None:
    """A drive's own and random inputs; parameters and parts that change; scalings; resets."""
    given = arguments()
    bench = Bench(dut, given["seed"], tuple(given["pauses"]))
    rng, board = bench.rng, bench.board
    drive = states.shipped("anpc5l_6kv")
    slopes = registers(drive, "fast", ROOM).array()[PLACES]
    own = observer.coefficients(drive)[0]
    cases = ["flux"]
    if given["filters"]:
        cases += ["filters flux", "filters"]
    if given["leakage"]:
        cases += ["flux leakage", "flux leakage"]
    if given["filters"] and given["leakage"]:
        cases += ["filters flux leakage"] * 3
    moved = 0
    for n in range(given["steps"]):
        k = n % 90
        if k == 0:
            await bench.reset()
            bench.o, bench.c = own, leakage.coefficients(drive)[0]
            bench.f = filters.coefficients(drive, rng.randrange(8), rng.randrange(8))
            current = np.zeros(2)
            parts = cases[-1]
        if k > 12:
            parts = rng.choice(cases)
        if given["filters"] and rng.random() < 0.05:
            await bench.reset("filters")
        if given["leakage"] and rng.random() < 0.03:
            await bench.reset("leakage")
        if k < 35:
            step = machine(rng, n, bench.c, current)
            step.parts, step.observed = parts, int(rng.random() < 0.3)
            step.frozen = int(k > 30)
        elif k < 75:
            step = any_step(rng, parts)
            if k > 50:
                bench.f, bench.c = any_filters(rng), any_leakage(rng)
                bench.o = {name: word(rng, 18) >> rng.randrange(14) for name in bench.o}
        else:
            # at full scale: charges that drive voltages out, states that grow until they do not fit
            step = corners(rng, parts)
            bench.c = any_leakage(rng)
            bench.f = any_filters(rng) | dict.fromkeys(
                filters.COEFFICIENTS, rng.choice((HIGH, -HIGH))
            )
            bench.o = bench.o | dict.fromkeys(
                ("voltage_alpha", "voltage_beta", "pull", "decay"), MOST
            )
            if rng.random() < 0.5:
                step.s = np.array([7, 7, 0])
                step.m[2:7] = [0, 0, 0, 0, 60_000]
        before = bench.theta
        found = await bench.step(step)
        moved += bench.theta != before
        for part, words in found.items():
            board.cover(f"{part} saturated", words[-1])
            board.cover(f"{part} fits", 1 - words[-1])
        board.cover(step.parts)
        if given["leakage"] and n % 3 == 0:
            clipped = await bench.scale(slopes if k < 35 else any_slopes(rng))
            board.cover("clipped", clipped)
            board.cover("scaled", 1 - clipped)
            board.cover("as given", int(bench.theta == 1 << leakage.FRACTION))
    board.cover("moved", moved)
    part = given["steps"] // 90
    wanted = dict.fromkeys(cases, 2 * part) | {"reset": 1}
    for name in ("filters", "leakage"):
        if given[name]:
            wanted |= {f"{name} saturated": part, f"{name} fits": 3 * part, f"reset {name}": 1}
    wanted |= {"flux saturated": 3 * part, "flux fits": 10 * part}
    if given["leakage"]:
        wanted |= {"moved": 3 * part, "clipped": part, "scaled": 3 * part, "as given": part}
    board.finish({"estimate": given["steps"] // 3}, wanted)
