"""Cocotb side of ``test_state_observer``: steps and scalings against the twins."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mpdcc import capacitor_observer as filters
from directmpc.mpdcc import leakage, observer
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX, ROOM, registers
from scripts.generate import register_files
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")
FLUX = ("psir_alpha", "psir_beta")
SIGNED = {"is_alpha", "is_beta", "v_n", "omega_r", *FLUX}
VOLTAGES = ("used_n", "used_a", "used_b", "used_c")
#: Clocks from the start: to filters_valid, to valid, to leakage_valid, in which it is busy.
FILTERS = clocks_of("state_observer", "filters")
FILTERS_BUSY = clocks_of("state_observer", "filters_busy")
VALID = clocks_of("state_observer", "flux")
BUSY = clocks_of("state_observer", "flux_busy")
LEAKAGE = clocks_of("state_observer", "leakage")
LATER = clocks_of("state_observer", "filtered") - VALID
SCALING = clocks_of("state_observer", "scaling")
#: Clocks from the start on in which measurements hold still: with flux alone, with filters.
MEASURED, FILTERED = 12, 20
PLACES = [INDEX[name] for name in CURRENT_SLOPES]
#: Places of the coefficients in the observer's memory, and how wide it is.
STORED = register_files.places("mpdcc")
STORED_BITS = 18
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
        self.stored: dict[str, int] = {}
        self.order = random.Random(seed)  # of what does not count
        for name in (
            "start", "scale", "forget_filters", "forget_leakage", "frozen", "observed", "c_write"
        ):  # fmt: skip
            getattr(dut, name).value = 0
        for name in ("filters", "flux", "leakage"):
            getattr(dut, f"with_{name}").value = 0

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

    async def parameters(self) -> None:
        """Gains on the ports; coefficients that have changed to the memory, in any order."""
        for name in filters.SHIFTS:
            getattr(self.dut, f"f_{name}").value = self.f[name]
        # of 16 bits; what stands above them does not count
        wanted = {
            f"f_{name}": bits(self.f[name], 16) | self.order.randrange(4) << 16
            for name in filters.COEFFICIENTS
        }
        wanted = {
            name: self.stored[name] if self.stored.get(name, -1) & 0xFFFF == word & 0xFFFF else word
            for name, word in wanted.items()
        }
        wanted |= {f"o_{name}": bits(value, 18) for name, value in self.o.items()}
        wanted |= {f"l_{name}": bits(value, 18) for name, value in self.c.items()}
        await self.store(wanted)

    async def store(self, words: dict[str, int]) -> None:
        """Words to the memory, those that it has not, one in a clock."""
        dut = self.dut
        names = [name for name, word in words.items() if self.stored.get(name) != word]
        self.order.shuffle(names)
        for name in names:
            dut.c_write.value = 1
            dut.c_place.value, dut.c_word.value = STORED[name], words[name]
            self.stored[name] = words[name]
            await self.clock.tick()
        dut.c_write.value = 0
        dut.c_place.value = self.order.randrange(len(STORED))
        dut.c_word.value = self.order.getrandbits(STORED_BITS)
        self.board.cover("stored", len(names))

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
        await self.parameters()
        self.put(step)
        for part in ("filters", "flux", "leakage"):
            getattr(dut, f"with_{part}").value = step.has(part)
        dut.observed.value, dut.frozen.value = step.observed, step.frozen
        dut.start.value, dut.scale.value = 1, rng.randrange(2) * (1 - self.options["leakage"])
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
            dut.scale.value = rng.randrange(2)
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
        await self.store(
            {
                f"c_{name}": bits(int(w), 16) | self.order.randrange(4) << 16
                for name, w in zip(CURRENT_SLOPES, given, strict=True)
            }
        )
        dut.start.value, dut.scale.value = 1, 1
        await self.clock.tick()
        for count in range(1, SCALING + 1):
            dut.start.value, dut.scale.value = rng.randrange(2), rng.randrange(2)
            await self.clock.settle()
            board.check("busy", number(dut.busy), 1, f"{label}, {count}")
            board.check("scaling", number(dut.scaling), 1, f"{label}, {count}")
            for name in ("filters_valid", "valid", "leakage_valid"):
                board.check(name, number(getattr(dut, name)), 0, f"{label}, {count}")
            await self.clock.edge()
        dut.start.value, dut.scale.value = 0, 1
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
    whole = max(cases, key=len)  # every part
    moved = 0
    for n in range(given["steps"]):
        k = n % 90
        if k == 0:
            await bench.reset()
            bench.o, bench.c = own, leakage.coefficients(drive)[0]
            bench.f = filters.coefficients(drive, rng.randrange(8), rng.randrange(8))
            current = np.zeros(2)
            # filters alone leave it open whether there is a flux
            parts = "filters" if given["filters"] and n % 180 else whole
        elif k == 1:
            parts = whole
        if k > 12:
            # a flux that is to grow beyond its word needs most of the steps
            parts = whole if k >= 75 and rng.random() < 0.7 else rng.choice(cases)
        if given["filters"] and k < 75 and rng.random() < 0.05:
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
            if k % 5 == 0:
                bench.c = any_leakage(rng)
                bench.f = any_filters(rng) | {name: rng.randrange(4) for name in filters.SHIFTS}
                bench.f |= dict.fromkeys(filters.COEFFICIENTS, rng.choice((HIGH, -HIGH)))
                bench.o = own | dict.fromkeys(
                    ("voltage_alpha", "voltage_beta", "pull", "decay"), MOST
                )
            if k >= 80:
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
    wanted |= {"flux saturated": 2 * part, "flux fits": 10 * part}
    if given["leakage"]:
        wanted |= {"moved": 3 * part, "clipped": part, "scaled": 3 * part, "as given": part}
    board.finish({"estimate": given["steps"] // 3}, wanted)


NOWHERE = np.zeros(3, dtype=np.int64)


def alone(kind: str) -> bool:
    """Whether the test of this kind is not asked for."""
    return arguments()["alone"] != kind


@cocotb.test(skip=alone("flux"))
async def one_state_at_a_time(dut) -> None:
    """Every word and state of the flux overflows while all others fit; it is told in its step."""
    bench = Bench(dut, arguments()["seed"])
    rng, board = bench.rng, bench.board
    none = dict.fromkeys(observer.COEFFICIENTS, 0)

    async def step(c: dict[str, int], m: list[int], s: list[int] | None = None) -> int:
        bench.o = c
        found = await bench.step(Step(np.array(m), NOWHERE if s is None else np.array(s)))
        return found["flux"][2]

    await bench.reset()
    # the estimate itself, along one axis
    for axis, m in (("alpha", [32_767, 0]), ("beta", [0, 32_767])):
        board.cover(f"estimate {axis}", await step(none | {"output_current": MOST}, m + [0] * 6))
    # the voltage along alpha; only capacitors without a dc-link make it too large
    for s in ([1, 2, 2], [2, 1, 1]):
        board.cover("voltage", await step(none, [0, 0, -32_768, 65_535, 65_535, 65_535, 0, 0], s))
    # the angle: one pair of words alone is beyond
    for speed in (-(2**15), 2**15 - 1):
        board.cover("angle", await step(none | {"speed": -MOST - 1}, [0] * 7 + [speed]))
    # the stator flux, along one axis; seen once more in the next step it is another overflow
    for axis, s in (("alpha", [7, 0, 0]), ("beta", [7, 7, 0])):
        await bench.reset()
        for _ in range(12):
            told = await step(none | {f"voltage_{axis}": MOST}, [0] * 6 + [60_000, 0], s)
            board.cover(f"stator {axis}", told)
        board.check("kept", await step(none, [0] * 8), 0)
    # the rotor flux, before and after the second half of Heun's method: told with the next step,
    # and forgotten by a reset
    for kind in ("ahead", "rotor", "reset"):
        await bench.reset()
        grows = none | {"excitation": MOST, "decay": MOST}
        for _ in range(400):
            kick = turned(bench.state, rng) if kind == "ahead" else filled(bench.state)
            if kick is not None:
                break
            await step(grows, [32_767, 3_000, 0, 0, 0, 0, 0, 0])
        assert kick is not None, kind
        board.check("told at once", await step(kick[0], kick[1].tolist()), 0)
        if kind == "reset":
            await bench.reset()
        board.check("told with the next", await step(none, [0] * 8), int(kind != "reset"))
        board.cover(kind)
    board.finish(
        {"estimate": 200},
        {
            "estimate alpha": 1, "estimate beta": 1, "voltage": 1, "angle": 1, "stator alpha": 2,
            "stator beta": 2, "ahead": 1, "rotor": 1,
        },
    )  # fmt: skip


Inputs = tuple[dict[str, int], np.ndarray]


def ahead_fits(state: np.ndarray, inputs: Inputs) -> tuple[bool, bool]:
    """Whether the rotor's flux fits after Euler's step, and after Heun's."""
    c, m = inputs
    once = state.copy()
    observer.step_words(observer.array(c), once, m, NOWHERE)
    after = once[:2]
    q = m[7] * 4 * c["speed"] + 2**16 >> 17
    q = max(-MOST - 1, min(MOST, q))
    fits = True
    for x in range(2):
        psi = int(state[x]) >> observer.GUARD
        other = ~(int(state[1]) >> observer.GUARD) if x == 0 else int(state[0]) >> observer.GUARD
        total = (int(state[x]) << 13) + psi * c["decay"]
        total += (int(m[x]) + int(state[4 + x])) * 2 * c["excitation"] + (other * q << 6)
        fits = fits and abs(total) < 2**42
    return fits, bool(once[6] == 0) or bool(abs(after).max() < 2**29 - 1)


def turned(state: np.ndarray, rng: random.Random) -> Inputs | None:
    """A turn that overflows with Euler's step and fits after Heun's."""
    if state[0] < 0.9 * 2**29:
        return None
    for _ in range(60):
        c = dict.fromkeys(observer.COEFFICIENTS, 0) | {"speed": rng.randint(-MOST, MOST)}
        inputs = c, np.array([0] * 7 + [32_767])
        if overflown(state, inputs) == (0, 1) and ahead_fits(state, inputs) == (False, True):
            return inputs
    return None


def overflown(state: np.ndarray, inputs: Inputs) -> tuple[int, int]:
    """What a step would tell, and what it would leave for the next one to tell."""
    after = state.copy()
    c, m = inputs
    saturated = observer.step_words(observer.array(c), after, m, NOWHERE)[2]
    return int(saturated), int(after[6])


def filled(state: np.ndarray) -> Inputs | None:
    """The largest current that fits with Euler's step, where it overflows with Heun's."""
    c = dict.fromkeys(observer.COEFFICIENTS, 0) | {"excitation": MOST, "decay": MOST}
    low, high = -32_768, 32_767
    while low < high:
        middle = (low + high + 1) // 2
        fits = ahead_fits(state, (c, np.array([middle] + [0] * 7)))[0]
        low, high = (middle, high) if fits else (low, middle - 1)
    inputs = c, np.array([low] + [0] * 7)
    fits = ahead_fits(state, inputs)[0]
    return inputs if fits and overflown(state, inputs) == (0, 1) else None


#: Voltage -> its measurement among PORTS, and positions that charge nothing else.
LANES = {
    "v_n": (2, (3, 0, 0)),
    "v_ph_a": (3, (6, 0, 0)),
    "v_ph_b": (4, (0, 6, 0)),
    "v_ph_c": (5, (0, 0, 6)),
}


@cocotb.test(skip=alone("filters"))
async def one_voltage_at_a_time(dut) -> None:
    """Each voltage leaves its word at either end while the others fit; a step later all fit."""
    bench = Bench(dut, arguments()["seed"])
    board = bench.board
    strong = dict.fromkeys(filters.COEFFICIENTS, HIGH) | dict.fromkeys(filters.SHIFTS, 7)

    async def step(c: dict[str, int], m: list[int], s: tuple[int, ...]) -> int:
        bench.f = c
        found = await bench.step(Step(np.array(m), np.array(s), parts="filters"))
        return found["filters"][4]

    for lane, (place, s) in LANES.items():
        for upper in (True, False):
            await bench.reset()
            m = [0, 0, 0, 32_768, 32_768, 32_768, 0, 0]
            m[place] = (
                (HIGH if lane == "v_n" else 65_535)
                if upper
                else (-HIGH - 1 if lane == "v_n" else 0)
            )
            board.check("first", await step(strong, m, s), 0, lane)
            # the current that drives it out: along alpha for a and v_n, along beta for b and c
            current = HIGH if upper else -HIGH - 1
            m[0] = current if lane in ("v_n", "v_ph_a") else 0
            m[1] = {"v_ph_b": current, "v_ph_c": -1 - current}.get(lane, 0)
            board.cover(lane, await step(strong, m, s))
            # a reset forgets it, and so does a step that fits
            m[:2], m[place] = [0, 0], 32_768 if place > 2 else 0
            none = strong | dict.fromkeys(filters.COEFFICIENTS, 0)
            board.check("gone", await step(none, m, s), 0, lane)
    board.finish({"voltages": 24}, dict.fromkeys(LANES, 2))
