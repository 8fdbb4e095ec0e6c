"""Cocotb side of ``test_system``: registers, commits, decisions of a whole system."""

from __future__ import annotations

import random
from collections.abc import Coroutine
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge, with_timeout

from directmpc.api.drive_file import load_drive
from directmpc.host import registers
from directmpc.host.gate_guard import FAULTS, gates_of, stop_clocks
from directmpc.host.registers import registers_of
from directmpc.kbest import bit_true as kbest_bit_true
from directmpc.mpdcc import capacitor_observer, leakage, tables
from directmpc.mpdcc import observer as rotor_flux_observer
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.bit_true import paper as bit_true_paper
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX
from directmpc.mpdcc.formats import BOUND_HIGH
from directmpc.mpdcc.trace import IntArray
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc import observer as mptc_observer
from scripts.generate import register_files
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers import mptc_rows as mptc_core
from tb.helpers.scoreboard import Scoreboard, arguments, bits, number, word
from tb.rtl.system.bus import OKAY, SLVERR, Bus

CONTROL = {"enable": 0, "external_trip": 0, "start": 0}
#: Registers that only hardware writes, and the one that only software does.
WRITABLE = ("guard.", "bands.", "parameters.", "measurements.", "running.")
#: Registers with flags that a one clears.
FLAGS = ("system.flags", "system.faults", "result.sequencer")
#: Switch states a, b, c of the two-level vectors.
SWITCHES = ("000", "100", "110", "010", "011", "001", "101", "111")
#: What a decision has on its ports; of these the cost has a register of its own.
DECIDED = {
    "mpdcc": ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated"),
    "kbest": ("s_a", "s_b", "s_c", "held", "saturated", "cost"),
    "mptc": ("u_next", "saturated", "clamped"),
}
#: Code of each controller in capabilities, and its options.
BUILT = {
    "mpdcc": (
        1, "second_level", "weighted_deadlock", "inwards", "capacitor_filter", "leakage_estimate"
    ),
    "mptc": (2,),
    "kbest": (3, "capacitor_filter"),
}  # fmt: skip
NOT_THE_CORE_S = (
    "o_", "f_", "l_", "c_gain", "family_method", "duty_rule", "rate", "sensorless"
)  # fmt: skip


class System:
    """A system with its bus, and what the model says to it."""

    def __init__(self, dut, given: dict[str, Any]) -> None:
        self.dut, self.controller = dut, given["controller"]
        self.multilevel = self.controller != "mptc"
        self.folded = given.get("FOLDED", False)
        self.beam, self.stages = given.get("BEAM", 8), given.get("STAGES", 12)
        self.forget()
        self.rng = random.Random(given["seed"])
        self.bus = Bus(dut, self.controller, self.rng)
        self.board = Scoreboard()
        self.words = {w.name: w for w in register_files.parameters(self.controller)}
        self.inputs = {w.name: w for w in register_files.measurements(self.controller)}

    async def begin(self) -> None:
        """Reset, bus ready."""
        await self.bus.begin(CONTROL | dict.fromkeys(self.inputs, 0))

    async def settled(self) -> None:
        """Until no commit waits."""
        while await self.bus.read("system.status", "commit_pending"):
            pass

    def any_word(self, name: str) -> int:
        """A parameter of any content that is taken."""
        found = word(self.rng, self.words[name].width, signed=self.words[name].signed)
        if self.controller == "kbest":
            found = min(found, {"weight_neutral": 10, "weight_phase": 10}.get(name, found))
            return 1 + found % (self.stages - 1) if name == "short_stages" else found
        return min(found, BOUND_HIGH["fast"]) if name.startswith("bound_") else found

    def any_parameters(self) -> dict[str, int]:
        """Parameters of any content, for the model and for the registers."""
        found = {name: self.any_word(name) for name in self.words}
        if self.controller == "mpdcc":
            found |= {"horizon": max(1, found["horizon"]), "l_mode": 0}
        if self.multilevel:
            # the filters remember, a set of parameters does not: see `filtered`
            found |= dict.fromkeys(("f_q_midpoint", "f_q_phase"), 0)
        return found

    def shipped(self) -> Any:
        """The drive file that ships, as the system under test is built."""
        if self.controller == "mpdcc":
            return states.shipped("anpc5l_6kv")
        if self.controller == "mptc":
            return mptc_core.shipped("induction_2kw2")
        short = min(4, self.stages - 1)
        return load_drive("anpc5l_6kv_kbest").with_control(
            beam=self.beam, short_stages=short, long_stages=self.stages - short
        )

    def any_measurements(self) -> dict[str, int]:
        """Measurements of any content."""
        return {n: word(self.rng, w.width, signed=w.signed) for n, w in self.inputs.items()}

    def put(self, values: dict[str, int]) -> None:
        """Measurements on the ports."""
        for name, value in values.items():
            getattr(self.dut, name).value = (
                bits(value, self.inputs[name].width) if (self.inputs[name].signed) else value
            )

    def model(self, parameters: dict[str, int], m: dict[str, int]) -> tuple[int, ...]:
        """The model's decision: what ``decided`` reads."""
        register = np.array(
            [v for n, v in parameters.items() if not n.startswith(NOT_THE_CORE_S)], dtype=np.int64
        )
        values = np.array(list(m.values()), dtype=np.int64)
        if self.controller == "mpdcc":
            built = np.append(register, tables.base_of(tables.DEFAULT))
            model = bit_true_paper if self.folded else bit_true_fast
            found = model.decide_words(built, values[:13], values[13:])
        elif self.controller == "kbest":
            found = self.planned(register, values)
        else:
            found = mptc_bit_true.decide_words(register, values[:8], values[8])
        return tuple(int(v) for v in found)

    def planned(self, register: IntArray, values: IntArray) -> tuple[Any, ...]:
        """K-best's decision with the plan before; the next one is `following`."""
        built = np.array([*register, self.beam, self.stages], dtype=np.int64)
        parameters = kbest_bit_true.Parameters(built, kbest_bit_true.TABLES, self.plan)
        following = np.zeros_like(self.plan)
        code, saturated, _, cost = kbest_bit_true.decide_words(
            parameters, values[:13], values[13:], self.plan, following
        )
        s = values[13:].copy()
        if code:
            phase, move = divmod(code - 1, 3)
            s[phase] = kbest_bit_true.TABLES.neighbours[s[phase], move]
        self.following = following
        return *s, int(code == 0), saturated, cost

    def follow(self, parameters: dict[str, int], m: dict[str, int]) -> tuple[int, ...]:
        """The model's decision, whose plan the next one begins with."""
        wanted = self.model(parameters, m)
        self.plan = self.following
        return wanted

    def forget(self) -> None:
        """Forget the plan, as behind a reset."""
        self.plan = self.following = np.zeros(self.stages + 1, dtype=np.int64)

    def see_plan(self) -> None:
        """Take over the plan that the core decides with, from its start on."""
        if self.controller != "kbest":
            return
        plan, odd = self.dut.plan.value, self.dut.odd.value
        if plan.is_resolvable and odd.is_resolvable:  # else the first one is being gathered
            words = [int(plan) >> 4 * j & 15 for j in range(self.stages)]
            self.plan = np.array([*words, int(odd)], dtype=np.int64)

    def decided(self) -> tuple[int, ...]:
        """The decision on the ports."""
        return tuple(number(getattr(self.dut, name)) for name in DECIDED[self.controller])

    async def check_flux(self, m: dict[str, int], where: str) -> None:
        """One clock after valid ports and registers show the flux of the decision."""
        kind, shown = ("psir", "rotor") if self.multilevel else ("psis", "stator")
        wanted = [int(m[f"{kind}_{axis}"]) for axis in ("alpha", "beta")]
        coded = [bits(v, 16) for v in wanted]
        await FallingEdge(self.dut.clk)
        got = [number(getattr(self.dut, f"flux_{axis}")) for axis in ("alpha", "beta")]
        self.board.check("flux port", got, coded, where)
        got = [await self.bus.read(f"result.{shown}_flux", axis) for axis in ("alpha", "beta")]
        self.board.check("observed flux", got, wanted, where)
        got = [number(getattr(self.dut, f"flux_{axis}")) for axis in ("alpha", "beta")]
        self.board.check("flux port", got, coded, f"{where}, later")
        if self.controller == "mptc":
            self.board.check("speed port", number(self.dut.speed), 0, where)

    async def write_parameters(self, values: dict[str, int], share: float = 1.0) -> None:
        """Write shadows, all or some of them, in random order."""
        names = list(values)
        self.rng.shuffle(names)
        for name in names[: int(share * len(names))]:
            address, fields = self.bus.registers[f"parameters.{name}"]
            word = values[name] & (1 << fields["value"][1]) - 1
            while await self.bus.write_word(address, word) != OKAY:
                # a commit waits: nothing else may have refused it
                self.board.cover("busy")

    async def decide(self, m: dict[str, int]) -> int:
        """Start from the ports and wait; clocks from start to valid. Scrambles the ports."""
        await FallingEdge(self.dut.clk)
        self.put(m)
        self.dut.start.value = 1
        await RisingEdge(self.dut.clk)
        await FallingEdge(self.dut.clk)
        self.dut.start.value = 0
        self.put(self.any_measurements())
        clocks = 0
        while not number(self.dut.valid):
            clocks += 1
            assert clocks < 400, "no decision"
            self.see_plan()
            await FallingEdge(self.dut.clk)
        return clocks

    async def timed(self, access: Coroutine[Any, Any, Any]) -> Any:
        """An access and the clocks that it takes; it has to end."""
        clocks = 0

        async def count() -> None:
            nonlocal clocks
            while True:
                await RisingEdge(self.dut.clk)
                clocks += 1

        counter = cocotb.start_soon(count())
        found = await with_timeout(cocotb.start_soon(access), 2, "us")
        counter.cancel()
        self.board.longest("access", clocks)
        return found


async def every_register(system: System) -> None:
    """Reset values, strobes, refusals: against a table of what each register holds."""
    bus, board, rng = system.bus, system.board, system.rng
    held: dict[int, int] = {}
    masks: dict[int, int] = {}
    bounds = [
        at
        for name, (at, _) in registers_of(system.controller).items()
        if ".bound_" in name and system.controller == "mpdcc"
    ]
    for name, (address, fields) in registers_of(system.controller).items():
        if name.startswith("recorder."):  # not built: nobody, below
            continue
        mask = sum(((1 << width) - 1) << low for low, width, _ in fields.values())
        got, response = await bus.read_word(address)
        board.check("read response", response, SLVERR if name == "system.command" else OKAY, name)
        block, _, word_name = name.partition(".")
        if block == "running" or (block == "parameters" and system.words[word_name].optional):
            mask = 0  # not built: takes writes, keeps 0
        if name.startswith(WRITABLE):
            held[address], masks[address] = got, mask
            at_rest = {
                "guard.dead_time": registers.GUARD_DEAD_TIME,
                "guard.minimum_on": registers.GUARD_MINIMUM_TIME,
                "guard.minimum_off": registers.GUARD_MINIMUM_TIME,
            }
            board.check("reset value", got, at_rest.get(name, 0), name)
        elif name not in ("system.control", "system.command", *FLAGS):
            response = await bus.write_word(address, rng.getrandbits(32))
            board.check("read-only refuses", response, SLVERR, name)
    for round_ in range(2):
        bus.throttle((0.0, 0.4)[round_])
        for address in rng.sample(sorted(held), len(held)):
            # one to four bytes: the master makes strobes of them; fewer than four are refused
            first = rng.choice((0, 0, 0, 1, 2, 3))
            count = rng.randint(1, 4 - first) if first else rng.choice((1, 3, 4, 4))
            data = rng.randbytes(count)
            found = await bus.master.write(address + first, data)
            wanted = int.from_bytes(data, "little") & masks[address]
            takes = count == 4 and not (address in bounds and wanted > BOUND_HIGH["fast"])
            board.check("strobes", int(found.resp), OKAY if takes else SLVERR, hex(address))
            if takes:
                held[address] = wanted
        for address in rng.sample(sorted(held), len(held)):
            board.check("word", (await bus.read_word(address)), (held[address], OKAY), hex(address))
    map_ = registers_of(system.controller)
    known = {at for name, (at, _) in map_.items() if not name.startswith("recorder.")}
    none = [a for a in range(0, 1024, 4) if a not in known]
    for address in [map_["recorder.status"][0], map_["recorder.record"][0], *rng.sample(none, 8)]:
        board.check("nobody", (await bus.read_word(address))[1], SLVERR, hex(address))
        board.check("nobody", await bus.write_word(address, 5), SLVERR, hex(address))
    code = await bus.read("system.identification", "identification")
    board.check("identification", code, 0x444D5043)
    kind = await bus.read("system.capabilities", "controller")
    code, *options = BUILT[system.controller]
    board.check("controller", kind, code)
    for option in BUILT["mpdcc"][1:]:
        built_in = await bus.read("system.capabilities", option)
        board.check(option, built_in, int(option in options))
    if system.controller == "kbest":
        found = [await bus.read("result.search", name) for name in ("beam", "stages")]
        board.check("search", found, [system.beam, system.stages])
    bus.throttle(0.0)


async def atomic_commits(system: System, rounds: int) -> None:
    """Commits at any time while decisions run: each decision is all of one set."""
    bus, board, rng = system.bus, system.board, system.rng
    await bus.write("system.control", own_positions=0)
    sets = [system.any_parameters()]
    await system.write_parameters(sets[0])
    await bus.write("system.command", commit=1)
    while await bus.read("system.status", "commit_pending"):
        pass
    before = await bus.read("system.commits", "count")
    state = {"sure": 0, "asked": 0, "stop": False}

    async def host() -> None:
        while not state["stop"]:
            fresh = system.any_parameters()
            # not committed: nothing of it may be seen
            await system.write_parameters(system.any_parameters(), rng.random())
            await system.write_parameters(fresh)
            sets.append(fresh)
            state["asked"] += 1
            await bus.write("system.command", commit=1)
            if rng.random() < 0.5:
                asked = state["asked"]
                while await bus.read("system.status", "commit_pending"):
                    pass
                # decisions that begin from now on are of this set
                state["confirmed"] = asked

    task = cocotb.start_soon(host())
    state["confirmed"] = 0
    for n in range(rounds):
        if n % 60 == 0:
            bus.throttle(rng.choice([0.0, 0.0, 0.3]))
        m = system.any_measurements()
        least = max(state["sure"], state["confirmed"])
        await system.decide(m)
        got = system.decided()
        fits = [k for k in range(least, state["asked"] + 1) if system.model(sets[k], m) == got]
        board.check("one set", bool(fits), True, f"decision {n}: {got}, sets {least} on")
        board.cover("new set", int(fits[0] > state["sure"]))
        state["sure"] = fits[0]
        for _ in range(rng.choice([0, 0, 1, 7])):
            await FallingEdge(system.dut.clk)
    state["stop"] = True
    await task
    while await bus.read("system.status", "commit_pending"):
        pass
    bus.throttle(0.0)
    board.check("commits", await bus.read("system.commits", "count"), before + state["asked"])
    board.cover("commits", state["asked"])


async def decisions_and_flags(system: System, count: int) -> None:
    """A drive's own values: decisions, counters, flags, both sources."""
    bus, board, rng = system.bus, system.board, system.rng
    drive = system.shipped()
    found = registers.values(drive)
    for _, address, data in found.writes():
        assert await bus.write_word(address, data) == OKAY
    # what the drive does not need is 0
    parameters = {n: found.words.get(f"parameters.{n}", 0) for n in system.words}
    await bus.write("system.command", clear_counters=1)
    await bus.write("system.flags", saturated=1, deadlock=1, start_ignored=1, clamped=1)
    worst, seen = 0, set()
    for n in range(count):
        m = system.any_measurements()
        source = n % 2
        await bus.write("system.control", registers_as_source=source, own_positions=0)
        if source:
            for name, value in m.items():
                await bus.write(f"measurements.{name}", value=value)
            system.see_plan()
            await bus.write("system.command", start=1)
            while await bus.read("system.status", "busy"):
                pass
        else:
            # one clock for the registers of the measurements
            clocks = await system.decide(m)
            await FallingEdge(system.dut.clk)
            await FallingEdge(system.dut.clk)
            board.check("cycles", await bus.read("system.cycles", "last"), clocks, f"decision {n}")
        worst = max(worst, await bus.read("system.cycles", "last"))
        wanted = system.model(parameters, m)
        board.check("decision", system.decided(), wanted, f"decision {n}")
        await system.check_flux(m, f"decision {n}")
        names = DECIDED[system.controller]
        told = dict(zip(names, wanted, strict=True))
        seen |= {name for name in ("saturated", "deadlock", "clamped") if told.get(name)}
        places = {"cost": ("result.cost", "key")}
        shown = tuple(
            [await bus.read(*places.get(name, ("result.decision", name))) for name in names]
        )
        board.check("decision register", shown, wanted, f"decision {n}")
        for name, value in m.items():
            board.check("kept", await bus.read(f"measurements.{name}", "value"), value, name)
    board.check("worst", await bus.read("system.cycles", "worst"), worst)
    board.check("decisions", await bus.read("system.decisions", "count"), count)
    for name in ("saturated", "deadlock", "clamped"):
        board.check("flag", await bus.read("system.flags", name), int(name in seen), name)
    board.cover("flags", len(seen))
    # sticky: another bit's clearing does not touch it, its own does
    await bus.write("system.flags", start_ignored=1)
    board.check("sticky", await bus.read("system.flags", "saturated"), int("saturated" in seen))
    await bus.write("system.flags", saturated=1)
    board.check("cleared", await bus.read("system.flags", "saturated"), 0)
    # a start while busy
    await bus.write("system.control", own_positions=0)
    system.see_plan()
    m = system.any_measurements()
    await FallingEdge(system.dut.clk)
    system.put(m)
    system.dut.start.value = 1
    await FallingEdge(system.dut.clk)
    system.put(system.any_measurements())
    await FallingEdge(system.dut.clk)
    system.dut.start.value = 0
    while not number(system.dut.valid):
        await FallingEdge(system.dut.clk)
    board.check("ignored", system.decided(), system.model(parameters, m))
    board.check("flag", await bus.read("system.flags", "start_ignored"), 1)
    # a write that is refused tells, one that is taken does not
    await bus.write("system.flags", write_refused=1)
    await bus.write("system.control", own_positions=0)
    board.check("refused", await bus.read("system.flags", "write_refused"), 0)
    address, _ = bus.registers["system.status"]
    board.check("refused", await bus.write_word(address, 1), SLVERR, "read-only")
    board.check("refused", await bus.read("system.flags", "write_refused"), 1)
    await bus.write("system.flags", write_refused=1)
    board.check("refused", await bus.read("system.flags", "write_refused"), 0, "cleared")
    # the observer's flux in the measurement's place
    await observed(system, drive, parameters)
    # and once more: the estimate begins anew
    await observed(system, drive, parameters)
    assert rng is not None


async def observed(system: System, drive, parameters: dict[str, int]) -> None:
    """Decisions on the observer's flux, and on what the system applied itself."""
    bus, board = system.bus, system.board
    await bus.write("system.command", reset_observer=1)
    await bus.write("system.control", use_observer=1, own_positions=1)
    mpdcc = system.multilevel
    last = system.decided()[:3] if mpdcc else system.decided()[0]
    if mpdcc:
        c = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
        state = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
    else:
        c = mptc_observer.array(mptc_observer.coefficients(drive))
        state = np.zeros(4, dtype=np.int64)
    flux = (0, 0)
    for n in range(8):
        m = system.any_measurements()
        used = dict(m)
        if mpdcc:
            order = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")
            values = np.array([m[name] for name in order])
            flux = rotor_flux_observer.step_words(c, state, values, np.array(last))[:2]
            used |= {"psir_alpha": flux[0], "psir_beta": flux[1]}
            used |= dict(zip(("s_prev_a", "s_prev_b", "s_prev_c"), last, strict=True))
        else:
            used |= {"psis_alpha": flux[0], "psis_beta": flux[1], "u": last}
            values = np.array([m[name] for name in ("is_alpha", "is_beta", "omega_r", "v_dc")])
            flux = mptc_observer.step_words(c, state, values, last)[:2]
        await system.decide(m)
        wanted = system.model(parameters, {k: int(v) for k, v in used.items()})
        board.check("observed", system.decided(), wanted, f"decision {n}")
        await system.check_flux(used, f"decision {n}")
        last = wanted[:3] if mpdcc else wanted[0]
        for _ in range(3):
            await FallingEdge(system.dut.clk)


#: Gains, and whether a delay is compensated, the flux observed, positions are the system's own.
FILTERED = (
    {"q_midpoint": 4, "q_phase": 4},
    {"q_midpoint": 0, "q_phase": 3, "use_observer": 1},
    {"q_midpoint": 6, "q_phase": 0, "compensate": 1},
    {"q_midpoint": 2, "q_phase": 7, "compensate": 1, "own_positions": 1, "use_observer": 1},
)


async def filtered(system: System) -> None:
    """Decisions on the voltages of the filters, whose step comes first; they begin anew."""
    bus, board, rng = system.bus, system.board, system.rng
    drive = system.shipped()
    base = registers.values(drive).words
    o = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    alone = clocks_of("state_observer", "filters")
    before_flux = clocks_of("state_observer", "filtered") - clocks_of("state_observer", "flux")
    for chosen in FILTERED:
        gains = {name: chosen[name] for name in ("q_midpoint", "q_phase")}
        c = capacitor_observer.coefficients(drive, **gains)
        compensate, watched = chosen.get("compensate", 0), chosen.get("use_observer", 0)
        parameters = {n: base[f"parameters.{n}"] for n in system.words} | {"compensate": compensate}
        own = chosen.get("own_positions", 0)
        # without filters in between: what they have seen is forgotten
        for filters, given in ((dict.fromkeys(c, 0), 0), (c, own)):
            parameters |= {f"f_{name}": value for name, value in filters.items()}
            await system.write_parameters(parameters)
            await bus.write("system.command", commit=1)
            while await bus.read("system.status", "commit_pending"):
                pass
            await bus.write(
                "system.control", registers_as_source=0, own_positions=given, use_observer=watched
            )
            if filters is not c:
                held = set()
                for _ in range(12):
                    m = near(system, rng)
                    count = await system.decide(m)
                    held |= {count} if system.decided()[3] else set()
                    for _ in range(3):
                        await FallingEdge(system.dut.clk)
        holds, full = set(), 0
        before = np.array([m[f"s_prev_{x}"] for x in "abc"])  # what the decision before was given
        state = np.zeros(capacitor_observer.STATE_WORDS, dtype=np.int64)
        flux = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
        if watched:
            await bus.write("system.command", reset_observer=1)
        await bus.write("system.flags", observer_saturated=1)
        for n in range(14):
            if n == 9:
                await bus.write("system.command", reset_observer=1)
                state[:], flux[:] = 0, 0
            m = near(system, rng)
            if n == 0:  # far from what the filters knew before
                m |= {"v_n": 3_000, "v_ph_b": 20_000}
            if n in (9, 10):  # at full scale, and the charge drives both beyond
                m = system.any_measurements() | {"is_alpha": 32_767, "v_ph_a": 65_535}
                m |= {"v_n": -32_768, "s_prev_a": 2, "s_prev_b": 0, "s_prev_c": 0}
            last = system.decided()[:3]
            s = np.array(last if own else [m[f"s_prev_{x}"] for x in "abc"])
            used = dict(m) | dict(zip(("s_prev_a", "s_prev_b", "s_prev_c"), s, strict=True))
            names = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
            *voltages, over = capacitor_observer.step_words(
                capacitor_observer.array(c), state, np.array([m[name] for name in names]), s,
                compensate,
            )  # fmt: skip
            used |= dict(zip(names[2:], voltages, strict=True))
            full |= over
            if watched:
                order = (*names, "v_dc", "omega_r")
                values = np.array([used[name] for name in order])
                *estimate, over = rotor_flux_observer.step_words(
                    o, flux, values, before if compensate else s
                )
                used |= dict(zip(("psir_alpha", "psir_beta"), estimate, strict=True))
                full |= over
            before = s
            count = await system.decide(m)
            wanted = system.model(parameters, {name: int(used[name]) for name in system.inputs})
            holds |= {count} if wanted[3] else set()
            board.check("filtered", system.decided(), wanted, f"{chosen}, decision {n}")
            if watched:
                shown = [await bus.read("result.rotor_flux", axis) for axis in ("alpha", "beta")]
                said = [int(v) for v in estimate]
                board.check("observed flux", shown, said, f"{chosen}, decision {n}")
            board.cover("moved", int(any(used[name] != m[name] for name in names[2:])))
            for _ in range(3):
                await FallingEdge(system.dut.clk)
        board.check("told", await bus.read("system.flags", "observer_saturated"), full, chosen)
        board.cover("full", full)
        if holds and held and system.controller == "mpdcc":  # another one's clocks differ
            more = before_flux if watched else alone
            board.check("later", holds, {count + more for count in held}, chosen)
    await bus.write("system.control", registers_as_source=0, own_positions=0, use_observer=0)


#: Options beside the estimate of the leakage, and whether the next start comes at once.
ESTIMATED = (
    {"fast": 1},
    {"use_observer": 1, "q": 3},
    {"compensate": 1, "own_positions": 1, "fast": 1},
    {"compensate": 1, "use_observer": 1, "q": 5, "own_positions": 1},
)
CHOICES = 12  # states that are tried for a decision that the estimate changes
ESTIMATES = 28  # decisions of each; then theta is frozen, and forgotten


async def estimated(system: System) -> None:
    """Decisions with slopes that the estimate of the leakage scales; it is frozen and forgotten."""
    bus, board, rng = system.bus, system.board, system.rng
    drive = states.shipped("anpc5l_6kv").with_control(leakage_estimate=True)
    base = registers.values(drive).words
    o = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    c = leakage.array(leakage.coefficients(drive)[0])
    names = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")

    async def commit(
        words: dict[str, int], share: tuple[str, ...] = (), *, reset: bool = False
    ) -> None:
        await system.write_parameters({n: words[n] for n in share or words})
        await bus.write("system.command", commit=1)
        if reset:  # which ends a scaling
            await bus.write("system.command", reset_observer=1)
        while await bus.read("system.status", "commit_pending"):
            pass

    for chosen in ESTIMATED:
        q, watched = chosen.get("q", 0), chosen.get("use_observer", 0)
        compensate, own = chosen.get("compensate", 0), chosen.get("own_positions", 0)
        f = capacitor_observer.coefficients(drive, q, q)
        parameters = {n: base[f"parameters.{n}"] for n in system.words}
        parameters |= {f"f_{name}": value for name, value in f.items()}
        parameters |= {"compensate": compensate}
        await bus.write(
            "system.control", registers_as_source=0, own_positions=own, use_observer=watched
        )
        # what was estimated before is forgotten
        off = {"l_mode": 0, "f_q_midpoint": 0, "f_q_phase": 0}
        await commit(parameters | off, reset=chosen is ESTIMATED[0])
        if chosen is ESTIMATED[0]:  # the decision before is one that is known
            m = near(system, rng)
            await system.decide(m)
            before = np.array([m[f"s_prev_{x}"] for x in "abc"])
        await commit(parameters, ("l_mode", "f_q_midpoint", "f_q_phase"))
        await bus.write("system.command", reset_observer=1)
        await bus.write("system.flags", observer_saturated=1)
        state, flux = leakage.first(), np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
        voltages = np.zeros(capacitor_observer.STATE_WORDS, dtype=np.int64)
        frozen, full = 0, 0
        current, last = np.zeros(2), system.decided()[:3]
        slopes: dict[str, int] = {}  # of the decision before
        for n in range(ESTIMATES + 8):
            if n == ESTIMATES:
                frozen = 1
                await commit({"l_mode": 3})
            if n == ESTIMATES + 4:
                await bus.write("system.command", reset_observer=1)
                state, flux[:], voltages[:] = leakage.first(), 0, 0
            theta = int(state[0]) >> leakage.GUARD
            row = np.array([parameters.get(x, parameters.get(f"c_{x}", 0)) for x in INDEX])
            values = row.copy()
            full |= leakage.scaled(theta, row, values)
            scaled = {f"c_{x}": int(values[INDEX[x]]) for x in CURRENT_SLOPES}
            kept = current, voltages.copy(), flux.copy(), full
            for _ in range(CHOICES):  # the first that the estimate decides otherwise, or the last
                current, full = kept[0], kept[3]
                voltages[:], flux[:] = kept[1], kept[2]
                m = near(system, rng)
                s = np.array(last if own else [m[f"s_prev_{x}"] for x in "abc"])
                applied = before if compensate else s
                # a machine whose current moves more than the controller's
                known = np.array([*(m[x] for x in names), m["v_dc"]])
                volts = rotor_flux_observer.voltages(known, applied)[:2]
                current = 0.9 * current + 1.5 * np.array(volts) * c[:2] / 2**16
                if n % 5 == 2:  # decided before the step of the estimate has ended
                    current = np.array([m["is_alpha"], m["is_beta"]], dtype=float)
                m |= {"is_alpha": round(current[0]), "is_beta": round(current[1]), "omega_r": 8_000}
                used = dict(m) | dict(zip(("s_prev_a", "s_prev_b", "s_prev_c"), s, strict=True))
                if q:
                    *found, over = capacitor_observer.step_words(
                        capacitor_observer.array(f), voltages, np.array([m[x] for x in names]), s,
                        compensate,
                    )  # fmt: skip
                    used |= dict(zip(names[2:], found, strict=True))
                    full |= over
                words = np.array([used[x] for x in (*names, "v_dc", "omega_r")])
                # its voltages serve the estimate, its flux counts where it is asked for
                *estimate, over = rotor_flux_observer.step_words(o, flux, words, applied)
                if watched:
                    used |= dict(zip(("psir_alpha", "psir_beta"), estimate, strict=True))
                    full |= over
                inputs = {name: int(used[name]) for name in system.inputs}
                wanted = system.model(parameters | scaled, inputs)
                other = wanted != system.model(parameters, inputs)
                if other or n % 5 == 2 or wanted != system.model(parameters | slopes, inputs):
                    break
            slopes = scaled
            measured = np.array([*words, used["psir_alpha"], used["psir_beta"]])
            full |= leakage.step_words(c, state, measured, applied, frozen)[1]
            await system.decide(m)
            label = f"{chosen}, decision {n}"
            board.check("estimated", system.decided(), wanted, label)
            last, before = system.decided()[:3], s
            if not chosen.get("fast") or n % 4 == 0:
                for _ in range(60):
                    await FallingEdge(system.dut.clk)
                shown = await bus.read("result.leakage", "theta")
                board.check("theta", shown, int(state[0]) >> leakage.GUARD, label)
            board.cover("scaled", int(theta != 1 << leakage.FRACTION))
            board.cover("other decision", int(other))
        board.check("told", await bus.read("system.flags", "observer_saturated"), full, chosen)
    await bus.write("system.control", registers_as_source=0, own_positions=0, use_observer=0)
    await commit({"l_mode": 0})


def port_of(name: str) -> str:
    """Port of the guard that has the value of a register."""
    port = name.partition(".")[2]
    return "frozen_limit" if port == "frozen" else port


async def widest(system: System) -> None:
    """Bands that every measurement of this bench keeps, once they are committed."""
    await system.bus.write("guard.speed_limit", value=32_766)
    await system.bus.write("guard.frozen", periods=0)
    if system.multilevel:
        await system.bus.write("bands.v_ph_low", value=0)
        await system.bus.write("bands.v_ph_high", value=65_534)
        await system.bus.write("bands.v_n_limit", value=32_766)


def near(system: System, rng: random.Random) -> dict[str, int]:
    """Measurements of a drive whose capacitors are near their references, with noise."""
    m = dict.fromkeys(system.inputs, 0) | {"v_dc": 32_000}
    m |= {"is_alpha": 9_000 + rng.randrange(200), "iref_alpha": 9_000, "psir_beta": 4_000}
    m |= {"v_n": round(rng.gauss(0, 160))}
    m |= {f"v_ph_{x}": 16_000 + round(rng.gauss(0, 80)) for x in "abc"}
    return m | {f"s_prev_{x}": rng.randrange(8) for x in "abc"}


#: Options beside own positions, and the minimum time that makes commutations wait beyond a start.
SWITCHED = (
    {"q": 4, "minimum": 330},
    {"q": 3, "minimum": 480, "compensate": 1, "use_observer": 1},
)
INTERVAL = 180  # clocks from start to start
TRIP = 26  # step behind which the guard stops
BACK = 30  # step from which on it may run again
STEPS = 60
TRIES = 400


async def switched(system: System) -> None:
    """Filters and flux observer go by the gates, which wait for minimum times, and which stop."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    guard = dut.i_shell.i_guard
    names = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
    drive = system.shipped()
    o = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    base = registers.values(drive).words
    pace = 1 if system.controller == "mpdcc" else 2
    all_faults = dict.fromkeys(bus.registers["system.faults"][1], 1)

    whole = [sum(1 << gate - 1 for gate in gates_of(True, position)) for position in range(8)]

    def taken() -> IntArray:
        return np.array([number(getattr(guard, f"taken_{x}")) for x in "abc"])

    for chosen in SWITCHED:
        compensate, watched = chosen.get("compensate", 0), chosen.get("use_observer", 0)
        filters = capacitor_observer.coefficients(
            drive, q_midpoint=chosen["q"], q_phase=chosen["q"]
        )
        c = capacitor_observer.array(filters)
        parameters = {n: base[f"parameters.{n}"] for n in system.words} | {"compensate": compensate}
        parameters |= {f"f_{name}": value for name, value in filters.items()}
        dut.enable.value = 1
        await bus.write("system.control", enable=0, use_observer=watched, own_positions=1)
        settings = {
            "watchdog": 60_000, "decision_limit": 59_000, "current_limit": 30_000,
            "link_high": 65_000, "link_low": 0, "dead_time": 10,
            "minimum_on": pace * chosen["minimum"],
            "minimum_off": 1,
        }  # fmt: skip
        await system.settled()
        for name, value in settings.items():
            _, fields = bus.registers[f"guard.{name}"]
            await bus.write(f"guard.{name}", **{next(iter(fields)): value})
        await widest(system)
        await system.write_parameters(parameters)
        await bus.write("system.command", commit=1)
        await system.settled()
        decisions = []
        for _ in range(2):  # own positions are those of decisions
            await system.decide(near(system, rng))
            decisions.append(np.array(system.decided()[:3]))
        before, last = decisions
        await bus.write("system.command", reset_observer=1)
        await bus.write("system.faults", **all_faults)
        await bus.write("system.control", enable=1, use_observer=watched, own_positions=1)
        state = np.zeros(capacitor_observer.STATE_WORDS, dtype=np.int64)
        flux = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
        moved = latest = np.zeros(3, dtype=bool)  # legs that the last two decisions move
        ran = False  # gates have followed since the last start
        for n in range(STEPS):
            label = f"{chosen}, decision {n}"
            running = bool(number(dut.running))
            at = taken() if running else last  # undefined before the first
            waiting = number(guard.waits) if running else 0
            waits = np.array([bool(waiting & bit) for bit in (4, 2, 1)])
            for x in range(3 * running):  # a pattern that is whole is that of its leg's position
                on = number(dut.gates) >> 8 * x & 0xFF
                if on in whole:
                    board.check("taken", on, whole[int(at[x])], label)
            # with delay compensation a decision is for the next start, and applies from then on
            asked = before if compensate else last
            applied = at if ran and running else asked
            other = bool(np.any(applied != asked))
            if ran and running:
                board.check("applied", list(applied[~waits]), list(asked[~waits]), label)
            kept = state.copy(), flux.copy()
            system.see_plan()
            # a move of a leg that waits would be an overrun; moves of one that rests are looked for
            refused = waits | (moved if compensate else False)
            rests = moved if not compensate else latest
            for attempt in range(TRIES):
                state[:], flux[:] = kept
                m = near(system, rng)
                m |= {"is_alpha": 9_000 + rng.randrange(-2_000, 2_000)}
                m |= {"is_beta": rng.randrange(-2_000, 2_000)}
                *voltages, _ = capacitor_observer.step_words(
                    c, state, np.array([m[x] for x in names]), applied, 0
                )
                used = m | dict(zip(names[2:], voltages, strict=True))
                used |= dict(zip(("s_prev_a", "s_prev_b", "s_prev_c"), last, strict=True))
                if watched:
                    words = np.array([used[x] for x in (*names, "v_dc", "omega_r")])
                    *estimate, _ = rotor_flux_observer.step_words(o, flux, words, applied)
                    used |= dict(zip(("psir_alpha", "psir_beta"), estimate, strict=True))
                wanted = system.model(parameters, {x: int(used[x]) for x in system.inputs})
                moves = np.array(wanted[:3]) != last
                enough = np.any(moves & rests) or attempt > TRIES // 2
                if enough and not np.any(moves & refused):
                    break
            assert not np.any(moves & refused), label
            clocks = await system.decide(m)
            board.check("switched", system.decided(), wanted, label)
            board.cover("late commutation", int(other and ran and running))
            ran = running and bool(number(dut.running))
            before, last, moved, latest = last, np.array(wanted[:3]), moves, moved
            for _ in range(pace * INTERVAL - clocks):
                await FallingEdge(dut.clk)
            if n == TRIP:
                board.check("ran", ran, True, label)
                dut.external_trip.value = 1
                await FallingEdge(dut.clk)
                dut.external_trip.value = 0
                # what the filters know is forgotten; the flux is not
                state[:], ran = 0, False
            if n == BACK:
                await bus.write("system.control", enable=0, use_observer=watched, own_positions=1)
                await bus.write("system.faults", **all_faults)
                await bus.write("system.control", enable=1, use_observer=watched, own_positions=1)
        board.check("no fault", number(dut.faults), 0, chosen)
        board.check("ran", (ran, number(dut.running)), (True, 1), chosen)
        await bus.write("system.control", enable=0)
    await bus.write("system.control", registers_as_source=0, own_positions=0, use_observer=0)


async def faults(system: System) -> None:
    """Enable, trip, clear: the guard behind the registers."""
    bus, board, dut = system.bus, system.board, system.dut
    await bus.write("system.control", enable=0)
    await bus.write("system.faults", **dict.fromkeys(bus.registers["system.faults"][1], 1))
    quiet = dict.fromkeys(system.inputs, 0)
    quiet["v_dc"] = 32_000
    if system.multilevel:
        quiet |= {"v_ph_a": 16_000, "v_ph_b": 16_000, "v_ph_c": 16_000}
    settings = {
        "watchdog": 60_000, "decision_limit": 59_000, "current_limit": 100,
        "link_high": 40_000, "link_low": 20_000, "dead_time": 12, "minimum_on": 14,
        "minimum_off": 1,
    }  # fmt: skip
    guard = dut.i_shell.i_guard
    before = {name: number(getattr(guard, name)) for name in settings}
    for name, value in settings.items():
        _, fields = bus.registers[f"guard.{name}"]
        await bus.write(f"guard.{name}", **{next(iter(fields)): value})
    await widest(system)
    for name in settings:
        board.check("setting before", number(getattr(guard, name)), before[name], name)
    await bus.write("system.command", commit=1)
    while await bus.read("system.status", "commit_pending"):
        pass
    for name, value in settings.items():
        board.check("setting", number(getattr(guard, name)), value, name)

    async def enable() -> None:
        await bus.write("system.control", enable=1)
        for _ in range(40):
            await FallingEdge(dut.clk)
        await system.decide(quiet)
        first = system.decided()
        await system.decide(quiet)
        last = system.decided()
        for _ in range(150):
            await FallingEdge(dut.clk)
        board.check("running", number(dut.running), 1)
        if system.multilevel:
            legs = [gates_of(True, position) for position in last[:3]]
        else:
            # a decision of MPTC is applied with the start that follows it
            legs = [gates_of(False, int(bit)) for bit in SWITCHES[first[0]]]
        size = 8 if system.multilevel else 2
        wanted = sum(1 << (x * size + gate - 1) for x, leg in enumerate(legs) for gate in leg)
        board.check("gates", number(dut.gates), wanted, f"{first}, {last}")
        shown = await bus.read("system.gates", "gates")
        board.check("gates register", shown, number(dut.gates))

    async def off(what: str) -> None:
        """Gates at the rails are off, and all gates when the stop is over."""
        tabled_leg = system.multilevel
        rails = 0x090909 if tabled_leg else 0x3F
        board.check(what, (number(dut.running), number(dut.gates) & rails), (0, 0))
        for _ in range(stop_clocks(tabled_leg, settings["dead_time"]) - 1):
            await FallingEdge(dut.clk)
        board.check(what, number(dut.gates), 0)

    dut.enable.value = 1
    await enable()
    # a current above the limit: off with the clock after the one that keeps the measurements
    loud = quiet | {"is_alpha": -101}
    await system.decide(loud)
    await off("off")
    board.check("fault", await bus.read("system.faults", "over_current"), 1)
    board.check("fault", await bus.read("system.status", "fault"), 1)
    # clearing alone restarts nothing
    await bus.write("system.faults", over_current=1)
    board.check("cleared", await bus.read("system.faults", "over_current"), 0)
    board.check("cleared", await bus.read("system.status", "fault"), 0)
    await system.decide(quiet)
    await system.decide(quiet)
    board.check("stays off", (number(dut.running), number(dut.gates)), (0, 0))
    await bus.write("system.control", enable=0)
    await enable()
    await FallingEdge(dut.clk)
    dut.external_trip.value = 1
    await FallingEdge(dut.clk)
    dut.external_trip.value = 0
    await off("trip")
    board.check("fault", await bus.read("system.faults", "external_trip"), 1)
    await bus.write("system.faults", external_trip=1, over_current=1)
    for _ in range(3):
        await FallingEdge(dut.clk)
    board.check("cleared", number(dut.faults), 0)
    await bus.write("system.control", enable=0)
    await enable()
    await FallingEdge(dut.clk)
    dut.enable.value = 0
    await FallingEdge(dut.clk)
    await off("disabled")
    board.check("disabled", number(dut.faults), 0)


async def unmeasured(system: System) -> None:
    """Gates enabled while a decision runs whose measurement nobody has compared."""
    bus, board, dut = system.bus, system.board, system.dut
    dut.enable.value = 0
    await bus.write("system.control", enable=0)
    await bus.write("system.faults", **dict.fromkeys(bus.registers["system.faults"][1], 1))
    # limits that no measurement keeps
    await bus.write("guard.current_limit", value=0)
    await bus.write("guard.link_low", value=65_535)
    await bus.write("guard.dead_time", clocks=10)
    await widest(system)
    await bus.write("system.command", commit=1)
    while await bus.read("system.status", "commit_pending"):
        pass
    await bus.write("system.control", enable=1)
    trips = [FAULTS.index(name) for name in ("over_current", "link_low")]
    m = dict.fromkeys(system.inputs, 0) | {"is_alpha": 200}
    for _ in range(2):
        # the guard's first clocks of a decision pass before it is enabled
        await FallingEdge(dut.clk)
        system.put(m)
        dut.start.value = 1
        await FallingEdge(dut.clk)
        dut.start.value = 0
        for _ in range(8):
            await FallingEdge(dut.clk)
        dut.enable.value = 1
        board.check("deciding", number(dut.busy), 1)
        for _ in range(300):
            await FallingEdge(dut.clk)
            board.check("unmeasured", (number(dut.running), number(dut.gates)), (0, 0))
        board.check("no fault", number(dut.faults), 0)
        # the measurement of the next one is compared
        await system.decide(m)
        board.check("unmeasured", (number(dut.running), number(dut.gates)), (0, 0))
        board.check("compared", number(dut.faults), sum(1 << n for n in trips))
        dut.enable.value = 0
        await bus.write("system.faults", **dict.fromkeys(bus.registers["system.faults"][1], 1))


async def locks(system: System) -> None:
    """A commit that waits keeps shadows alone; settings are locked while enabled."""
    bus, board, dut = system.bus, system.board, system.dut
    guard = dut.i_shell.i_guard
    timed, enable_word = system.timed, 1

    # a decision, a commit that has to wait for it, then everything that must not wait
    control, _ = bus.registers["system.control"]
    faults_at, _ = bus.registers["system.faults"]
    shadow, _ = bus.registers[f"parameters.{next(iter(system.words))}"]
    for access in range(4):
        await bus.write_word(control, enable_word)
        kept = await bus.read_word(shadow)
        deciding = cocotb.start_soon(system.decide(system.any_measurements()))
        await FallingEdge(dut.clk)
        assert await timed(bus.write("system.command", commit=1)) is None
        if access == 0:
            response = await timed(bus.write_word(shadow, 0x1234))
            board.check("busy", response, SLVERR)
        elif access == 1:
            board.check("not busy", await timed(bus.write_word(control, 0)), OKAY)
            board.check("disabled", number(dut.i_shell.enabled), 0)
        elif access == 2:
            board.check("not busy", await timed(bus.write_word(faults_at, 0x7FFF)), OKAY)
        else:
            response = await timed(bus.write_word(control, enable_word))
            board.check("busy", response, SLVERR)
        shown = await timed(bus.read("system.status", "commit_pending"))
        board.check("pending", shown, 1, f"access {access}")
        await deciding
        while await bus.read("system.status", "commit_pending"):
            pass
        if access == 0:
            board.check("kept", await bus.read_word(shadow), kept)
        board.check("after", await bus.write_word(shadow, kept[0]), OKAY)
    # settings while enabled: refused, whatever is committed
    await bus.write_word(control, enable_word)
    names = [name for name in bus.registers if name.startswith(("guard.", "bands."))]
    before = {name: number(getattr(guard, port_of(name))) for name in names}
    for name in names:
        address, _ = bus.registers[name]
        word, _ = await bus.read_word(address)
        board.check("locked", await bus.write_word(address, ~word & 0xFFF), SLVERR, name)
        board.check("locked", await bus.read_word(address), (word, OKAY), name)
    await bus.write("system.command", commit=1)
    while await bus.read("system.status", "commit_pending"):
        pass
    for name in names:
        board.check("locked", number(getattr(guard, port_of(name))), before[name], name)
    # settings that no commit has brought into force: no enable
    await bus.write_word(control, 0)
    await bus.write("guard.watchdog", clocks=1234)
    board.check("not in force", await bus.write_word(control, enable_word), SLVERR)
    board.check("not in force", await bus.read("system.status", "enabled"), 0)
    board.check("not in force", await bus.write_word(control, 2), OKAY)
    await bus.write("system.command", commit=1)
    while await bus.read("system.status", "commit_pending"):
        pass
    board.check("in force", await bus.write_word(control, enable_word), OKAY)
    board.check("in force", number(guard.watchdog), 1234)
    await bus.write_word(control, 0)


async def untaken(system: System) -> None:
    """Data that the master does not take keeps no write waiting, and a response no read."""
    bus, board, dut = system.bus, system.board, system.dut
    bus.throttle(0)
    name = next(iter(system.inputs))
    address, _ = bus.registers[f"measurements.{name}"]
    control, _ = bus.registers["system.control"]
    status, _ = bus.registers["system.status"]
    responses, data = bus.master.write_if.b_channel, bus.master.read_if.r_channel
    for count in range(1, 6):
        # with a bit of control that shows in no decision, so that the write is seen
        await bus.write_word(control, 2)
        data.pause = True
        reads = [cocotb.start_soon(bus.read_word(status)) for _ in range(count)]
        await ClockCycles(dut.clk, 40)
        board.check("untaken data", await system.timed(bus.write_word(control, 0)), OKAY)
        data.pause = False
        board.check("carried out", await bus.read_word(control), (0, OKAY))
        for read in reads:
            board.check("late data", (await read)[1], OKAY)
        responses.pause = True
        write = cocotb.start_soon(bus.write_word(address, 100 + count))
        refused = cocotb.start_soon(bus.write_word(status, 1))
        await ClockCycles(dut.clk, 40)
        board.check("untaken response", await system.timed(bus.read_word(address)),
                    (100 + count, OKAY))  # fmt: skip
        responses.pause = False
        board.check("late response", (await write, await refused), (OKAY, SLVERR))


@cocotb.test()
async def system(dut) -> None:
    """Everything a host does."""
    given = arguments()
    under_test = System(dut, given)
    await under_test.begin()
    if given["only"]:
        await {"estimated": estimated, "switched": switched}[given["only"]](under_test)
        under_test.board.finish({given["only"]: 1})
        return
    if given["registers"]:
        await every_register(under_test)
    await atomic_commits(under_test, given["rounds"])
    await decisions_and_flags(under_test, given["decisions"])
    if under_test.multilevel:
        await filtered(under_test)
    if given["controller"] == "mpdcc":
        await estimated(under_test)
    if under_test.multilevel:
        await switched(under_test)
    await faults(under_test)
    await unmeasured(under_test)
    dut.enable.value = 1
    await locks(under_test)
    await untaken(under_test)
    under_test.board.finish(
        {
            "word": 60 * given["registers"],
            "one set": given["rounds"],
            "decision": given["decisions"],
            "observed": 16,
            "setting": 8,
            "trip": 1,
            "unmeasured": 600,
            "pending": 4,
            "untaken data": 5,
            "untaken response": 5,
            "locked": 24,
            "not in force": 3,
        },
        {"new set": 4, "commits": 4, "flags": 1},
    )
    board = under_test.board
    if under_test.multilevel:
        assert board.checks["filtered"] == 14 * len(FILTERED)
        assert board.checks["switched"] == STEPS * len(SWITCHED)
        assert board.checks["taken"] > STEPS
        assert board.checks["applied"] > STEPS
        assert board.covered["late commutation"] > 10
        assert board.covered["moved"] > 20
        assert board.covered["full"] > 1
    if given["controller"] == "mpdcc":
        assert board.checks["later"] > 1
        assert board.checks["estimated"] == (ESTIMATES + 8) * len(ESTIMATED)
        assert board.checks["theta"] > ESTIMATES * len(ESTIMATED) // 2
        assert board.covered["scaled"] > ESTIMATES * len(ESTIMATED) // 2
        assert board.covered["other decision"] > 4
