"""Cocotb side of ``test_mpdcc_system``."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge

from directmpc.host import registers
from directmpc.mpdcc import leakage
from directmpc.mpdcc import observer as rotor_flux_observer
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX
from scripts.hdl import states
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import NOT_THE_CORE_S, System, near

VOLTAGES = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
POSITIONS = ("s_prev_a", "s_prev_b", "s_prev_c")
AT_REST = 3  # clocks between two decisions
#: The fast explorer has no use for them.
WITHOUT_EFFECT = ("c_correction_alpha", "c_correction_beta")
#: Options beside which a parameter is changed.
BESIDE = {
    "mpdcc": (
        {},
        {"two_switchings": 1},
        {"two_switchings": 1, "compensate": 1},
        {"deadlock_rule": 1},
        {"outside_inwards": 1},
    ),
    "kbest": ({}, {"compensate": 1}),
}
TRIES = 2_000  # states that are tried for a decision that a parameter changes


def shipped(system: System) -> dict[str, int]:
    """Parameters of the drive that ships, those of the observers included."""
    drive = system.shipped()
    if system.controller == "kbest":
        found = registers.values(drive).words
        return {name: found[f"parameters.{name}"] for name in system.words}
    found = registers.values(drive.with_control(leakage_estimate=True)).words
    return {name: found[f"parameters.{name}"] for name in system.words} | {"l_mode": 0}


def state_near(system: System) -> dict[str, int]:
    """Measurements as a drive has them, the current anywhere near its bounds."""
    rng = system.rng
    m = near(system, rng)
    m["is_alpha"] += rng.randrange(-2_000, 2_000)
    around = {"is_beta": 2_000, "iref_beta": 3_000, "psir_alpha": 4_000}
    around |= {"omega_s": 16_000, "omega_r": 16_000}
    return m | {name: rng.randrange(-most, most) for name, most in around.items()}


async def commit(system: System, words: dict[str, int]) -> None:
    """Parameters, in force."""
    await system.write_parameters(words)
    await system.bus.write("system.command", commit=1)
    await system.settled()


async def step(system: System, m: dict[str, int]) -> tuple[int, list[int]]:
    """A decision; clocks to valid, and those in which the guard gets one."""
    dut = system.dut
    await FallingEdge(dut.clk)
    system.put(m)
    dut.start.value = 1
    given, clocks = [], None
    for n in range(6_000):
        await FallingEdge(dut.clk)
        dut.start.value = 0
        system.put(system.any_measurements())
        if number(dut.apply):
            given.append(n)
        if clocks is not None and n == clocks + AT_REST:
            break
        if clocks is None and number(dut.valid):
            clocks = n
    assert clocks is not None, "no decision"
    return clocks, given


async def capabilities(system: System, wanted: dict[str, int]) -> None:
    """Everything that says what is built in."""
    for name in system.bus.registers["system.capabilities"][1]:
        found = await system.bus.read("system.capabilities", name)
        system.board.check(f"capability {name}", found, wanted.pop(name))
    system.board.check("capabilities", wanted, {})


async def parameters_alone(system: System) -> None:
    """Each parameter of the core changed alone, where that changes the decision."""
    board, rng = system.board, system.rng
    shipped_words = shipped(system)
    await system.bus.write("system.control", own_positions=0, use_observer=0)
    for name in (n for n in system.words if not n.startswith(NOT_THE_CORE_S)):
        about, found = system.words[name], False
        for n in range(TRIES):
            beside = BESIDE[system.controller]
            base = shipped_words | beside[n % len(beside)]
            m = system.any_measurements() if rng.random() < 0.4 else state_near(system)
            change = {name: system.any_word(name)}
            if name == "horizon":
                change = {name: rng.randrange(1, 64)}
            elif about.width == 1:
                change = {name: 1 - base[name]}
            decided = system.model(base | change, m)
            others = [system.model(base, m)]
            if name.endswith("_alpha"):
                partner = name.removesuffix("_alpha") + "_beta"
                others.append(system.model(base | {partner: change[name]}, m))
                others.append(system.model(base | {name: base[partner]}, m))
            found = decided not in others
            if found:
                break
        if not found:
            board.cover(f"without effect: {name}")
            continue
        await commit(system, base | change)
        await step(system, m)
        decided = system.follow(base | change, m)
        board.check("alone", system.decided(), decided, f"{name}: {change[name]}, {m}")
        await commit(system, {name: base[name]})
        await step(system, m)
        board.check("back", system.decided(), system.follow(base, m), name)


async def resets(system: System, rounds: int) -> None:
    """A reset in any clock of a decision or of a commit; what follows is as behind power-up."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    base = shipped(system)
    drive = system.shipped()
    o = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    for n in range(rounds):
        compensate, watched = n % 2, n // 2 % 2
        await commit(system, base | {"compensate": compensate})
        await bus.write("system.control", own_positions=1, use_observer=watched)
        for _ in range(3):
            await step(system, state_near(system))
        waits = n % 3 == 0
        if waits:  # a decision waits for its parameters
            await bus.write("system.command", commit=1)
            for _ in range(rng.randrange(3, 12)):
                await FallingEdge(dut.clk)
        await FallingEdge(dut.clk)
        if n % 3 != 2:
            system.put(state_near(system))
            dut.start.value = 1
            await FallingEdge(dut.clk)
            dut.start.value = 0
            for _ in range(rng.randrange(1, 50 if waits else 130)):
                await FallingEdge(dut.clk)
            board.cover("waited", int(number(dut.waiting)))
        dut.rst.value = 1
        for _ in range(rng.choice([1, 2, 5])):
            await FallingEdge(dut.clk)
        dut.rst.value = 0
        system.forget()
        where = f"round {n}"
        for _ in range(260):
            await FallingEdge(dut.clk)
            quiet = [number(port) for port in (dut.busy, dut.valid, dut.apply, dut.running)]
            board.check("quiet", quiet, [0, 0, 0, 0], where)
        # configured with the other option: nothing that waited is given
        compensate = rng.choice([0, 1, 1])
        await commit(system, base | {"compensate": compensate})
        await bus.write("system.control", own_positions=1, use_observer=1)
        flux = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
        before = last = np.zeros(3, dtype=np.int64)
        for k in range(3):
            m = state_near(system)
            words = np.array([m[x] for x in (*VOLTAGES, "v_dc", "omega_r")])
            *estimate, _ = rotor_flux_observer.step_words(
                o, flux, words, before if compensate else last
            )
            used = dict(m) | dict(zip(("psir_alpha", "psir_beta"), estimate, strict=True))
            used |= dict(zip(POSITIONS, last, strict=True))
            wanted = system.follow(base | {"compensate": compensate}, used)
            clocks, given = await step(system, m)
            where = f"round {n}, decision {k} behind the reset, compensate {compensate}"
            board.check("decision", system.decided(), wanted, where)
            shown = [await bus.read("result.rotor_flux", axis) for axis in ("alpha", "beta")]
            board.check("flux", shown, [int(v) for v in estimate], where)
            due = ([0] if k else []) if compensate else [clocks + 1]
            board.check("given", given, due, where)
            before, last = last, np.array(wanted[:3])


async def handed_over(system: System) -> None:
    """A decision that waits for its start is given, though delay compensation has been ended."""
    base = shipped(system)
    await system.bus.write("system.control", own_positions=1)
    for n in range(3):
        await commit(system, base | {"compensate": 1})
        await step(system, state_near(system))
        await commit(system, base | {"compensate": 0})
        clocks, given = await step(system, state_near(system))
        system.board.check("handed over", given, [0, clocks + 1], f"round {n}")


async def forgotten(system: System) -> None:
    """The observer's reset waits for the end of the decision that it meets."""
    bus, board, rng = system.bus, system.board, system.rng
    base = shipped(system)
    drive = system.shipped()
    o = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    await commit(system, base)
    await bus.write("system.control", own_positions=0, use_observer=1)
    await bus.write("system.command", reset_observer=1)
    system.forget()
    flux = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
    for n in range(24):
        m = state_near(system)
        applied = np.array([m[x] for x in POSITIONS])
        words = np.array([m[x] for x in (*VOLTAGES, "v_dc", "omega_r")])
        *estimate, _ = rotor_flux_observer.step_words(o, flux, words, applied)
        used = dict(m) | dict(zip(("psir_alpha", "psir_beta"), map(int, estimate), strict=True))
        meets = n % 2
        if meets:

            async def meet(after: int) -> None:
                for _ in range(after):
                    await FallingEdge(system.dut.clk)
                await bus.write("system.command", reset_observer=1)

            cocotb.start_soon(meet(rng.randrange(24)))
        await step(system, m)
        board.check("forgotten", system.decided(), system.follow(base, used), f"decision {n}")
        if meets:
            flux[:] = 0
            system.forget()
            await bus.read("system.status", "busy")


async def never_ahead(system: System, *, observer: int) -> None:
    """Without a second level a decision is given at once, whatever compensate says.

    Without an observer it is the model's on what is measured, whatever asks for an estimate.
    """
    found = registers.values(system.shipped(), "paper" if system.folded else "fast").words
    base = {name: found[f"parameters.{name}"] for name in system.words}
    ignored = dict.fromkeys(("f_q_midpoint", "f_q_phase", "l_mode"), 1 - observer)
    await commit(system, base | ignored | {"compensate": 1})
    await system.bus.write("system.control", own_positions=0, use_observer=1 - observer)
    for n in range(6):
        m = state_near(system)
        clocks, given = await step(system, m)
        system.board.check("given", given, [clocks + 1], f"decision {n}")
        system.board.check("decided", system.decided(), system.model(base, m), f"decision {n}")


async def estimate(system: System) -> None:
    """The leakage's overflows told, theta forgotten without its mode; no scaling without it."""
    bus, board = system.bus, system.board
    base = shipped(system)
    drive = states.shipped("anpc5l_6kv").with_control(leakage_estimate=True)
    c = leakage.array(leakage.coefficients(drive)[0])
    await bus.write("system.control", own_positions=0, use_observer=0)
    row = np.array([base.get(x, base.get(f"c_{x}", 0)) for x in INDEX])
    for turn in range(2):
        await commit(system, base | {"l_mode": 1})
        await bus.write("system.command", reset_observer=turn)
        theta = await bus.read("result.leakage", "theta")
        board.check("theta", theta, 1 << leakage.FRACTION, "behind a commit")
        state = leakage.first()
        for n in range(24):
            m = state_near(system) if n % 3 else system.any_measurements()
            applied = np.array([m[x] for x in POSITIONS])
            measured = np.array([m[x] for x in (*VOLTAGES, "v_dc", "omega_r", "psir_alpha",
                                                "psir_beta")])  # fmt: skip
            values = row.copy()
            clipped = leakage.scaled(int(state[0]) >> leakage.GUARD, row, values)
            scaled = {f"c_{x}": int(values[INDEX[x]]) for x in CURRENT_SLOPES}
            wanted = system.model(base | scaled, m)
            await bus.write("system.flags", observer_saturated=1)
            await step(system, m)
            board.check("estimated", system.decided(), wanted, f"decision {n}")
            over = leakage.step_words(c, state, measured, applied, 0)[1]
            for _ in range(120):
                await FallingEdge(system.dut.clk)
            told = await bus.read("system.flags", "observer_saturated")
            board.check("told", told, int(clipped or over), f"decision {n}")
            board.cover("step alone", int(over and not clipped))
            board.cover("nothing", int(not over and not clipped))
            theta = await bus.read("result.leakage", "theta")
            board.check("theta", theta, int(state[0]) >> leakage.GUARD, f"decision {n}")
        assert int(state[0]) != leakage.ONE
        await commit(system, {"l_mode": 0})
        theta = await bus.read("result.leakage", "theta")
        board.check("theta", theta, 1 << leakage.FRACTION, "without the estimate")
    # the observer begins anew: the next decision comes as early as any
    m = state_near(system)
    usual, _ = await step(system, m)
    for _ in range(4):
        await bus.write("system.command", reset_observer=1)
        clocks, _ = await step(system, m)
        board.check("clocks", clocks, usual, "behind the observer's reset")


@cocotb.test()
async def system(dut) -> None:
    """What a system of MPDCC does beside what both have in common."""
    given = arguments()
    under_test = System(dut, given | {"controller": "mpdcc"})
    await under_test.begin()
    board = under_test.board
    second = given["SECOND_LEVEL"] and not given["FOLDED"]
    fast, observer = not given["FOLDED"], int(given.get("FLUX_OBSERVER", True))
    built = {
        "controller": 1, "explorers": 1, "folded": int(given["FOLDED"]),
        "second_level": int(second), "weighted_deadlock": int(fast), "inwards": int(fast),
        "capacitor_filter": observer, "leakage_estimate": int(fast and observer),
        "flux_control": 0, "family": 0, "sensorless": 0, "observer": observer,
        "least_dead_time": 10, "recorder": 0,
    }  # fmt: skip
    await capabilities(under_test, built)
    if not second:
        await never_ahead(under_test, observer=observer)
        board.finish({"given": 6, "decided": 6})
        return

    await parameters_alone(under_test)
    for name in under_test.words:
        assert not board.covered[f"without effect: {name}"] or name in WITHOUT_EFFECT, name
    await estimate(under_test)
    await handed_over(under_test)
    await forgotten(under_test)
    await resets(under_test, given["rounds"])
    board.finish(
        {"alone": 30, "back": 30, "decision": 3 * given["rounds"], "quiet": 200 * given["rounds"],
                      "theta": 50, "told": 48, "clocks": 4, "handed over": 3, "forgotten": 24},
        {"step alone": 2, "nothing": 2, "waited": given["rounds"] // 6},
    )  # fmt: skip
