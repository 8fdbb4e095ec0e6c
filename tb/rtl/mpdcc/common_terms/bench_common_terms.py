"""Cocotb side of ``test_common_terms``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.program import COEFFICIENTS, PROGRAM_LENGTHS, SIGNALS
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, word

#: Clocks from start to done, as the entity's header declares; issued comes five clocks before.
LATENCIES = {v: clocks_of("common_terms", "done", v) for v in PROGRAM_LENGTHS}
ISSUED_BEFORE = 5
#: Clocks from start to the pulse after which the capacitors' terms are there.
CAPACITORS = {v: clocks_of("common_terms", "capacitors", v) for v in PROGRAM_LENGTHS}


def operands(rng: random.Random, kind: str) -> dict[str, int]:
    """Operands A: of a measurement, perhaps with other differences, or all most negative."""
    # of two signed words; of v_dc and twice v_ph
    ranges = {
        name: (-65535, 65535) if name.endswith(("_alpha", "_beta")) else (-131070, 65535)
        for name in SIGNALS
        if name not in f.MEASUREMENTS
    }
    free = {name: rng.choice([low, high, rng.randint(low, high)])
            for name, (low, high) in ranges.items()}  # fmt: skip
    if kind == "lowest":
        lowest = {name: -(1 << 15) * fmt.signed for name, fmt in f.MEASUREMENTS.items()}
        return lowest | {name: low for name, (low, _) in ranges.items()}
    measurement = {
        name: word(rng, fmt.width, signed=fmt.signed) for name, fmt in f.MEASUREMENTS.items()
    }
    return plain.signals_of(measurement) | (free if kind == "any" else {})


def capacitor_terms(node: str) -> list[str]:
    """Errors and current terms of v_n and v_ph in a packed node, bit 0 first."""
    found, offset = [], 0
    for name, words, width in plain.NODE_FIELDS:
        for i in range(words):
            if (name == "error" and i >= 3) or name in ("phase_current", "neutral_current"):
                found.append(node[offset : offset + width])
            offset += width
    return found


@cocotb.test()
async def random_nodes(dut) -> None:
    """Random operands, some computations cut off by a reset."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    width = f.COEFFICIENT_WIDTH
    variant = given["variant"]
    latency, capacitors = LATENCIES[variant], CAPACITORS[variant]

    def apply(signal: dict[str, int], speed: list[int], coefficient: dict[str, int]) -> None:
        dut.signals.value = join([signal[name] for name in SIGNALS], f.OPERAND_WIDTH)
        dut.speeds.value = join(speed, width)
        dut.coefficients.value = join([coefficient[name] for name in COEFFICIENTS], width)

    def scramble() -> None:
        dut.signals.value = rng.getrandbits(len(SIGNALS) * f.OPERAND_WIDTH)
        dut.speeds.value = rng.getrandbits(2 * width)
        dut.coefficients.value = rng.getrandbits(len(COEFFICIENTS) * width)

    dut.start.value = 0
    scramble()
    await clock.reset(6)
    for n in range(given["nodes"]):
        kind = "lowest" if n % 50 == 1 else "any" if n % 3 == 0 else "measured"
        signal = operands(rng, kind)
        speed = [word(rng, width), word(rng, width)]
        small = rng.random() < 0.4
        coefficient = {
            name: word(rng, width) >> (rng.randrange(4, 12) if small else 0)
            for name in COEFFICIENTS
        }
        if kind == "lowest":
            speed, coefficient = [-(1 << 15)] * 2, dict.fromkeys(COEFFICIENTS, -(1 << 15))
        node = plain.common_terms(signal, speed[0], speed[1], coefficient, variant)
        apply(signal, speed, coefficient)
        dut.start.value = 1
        await clock.tick()
        dut.start.value = 0
        stop = rng.randrange(1, latency) if rng.random() < 0.06 else 0
        for k in range(1, latency):
            board.check("not done yet", number(dut.done), 0, f"clock {k}")
            board.check("issued", number(dut.issued), int(k == latency - ISSUED_BEFORE), f"{k}")
            board.check("capacitors", number(dut.capacitors), int(k == capacitors), f"{k}")
            if k == capacitors + 1:
                got = str(dut.node.value)[::-1]
                want = f"{plain.pack_node(node):0{len(got)}b}"[::-1]
                board.check("capacitor terms", capacitor_terms(got), capacitor_terms(want))
            if k == stop:
                break
            await clock.tick()
        if stop:
            scramble()
            await clock.reset(1)
            for _ in range(latency + 2):
                board.check("silent after reset", number(dut.done), 0)
                await clock.tick()
            board.cover("reset")
            continue
        context = f"node {n} ({kind})"
        board.check("done", number(dut.done), 1, context)
        board.check("node", number(dut.node), plain.pack_node(node), context)
        board.check("saturated", number(dut.saturated), int(node.saturated), context)
        board.cover("saturated" if node.saturated else "in range")
        for _ in range(rng.choice([0, 0, 1, 7])):
            scramble()
            await clock.tick()
            board.check("one pulse", number(dut.done), 0, context)
            board.check("node stays", number(dut.node), plain.pack_node(node), context)
            board.cover("idle")
    board.finish(
        {"node": int(0.8 * given["nodes"]), "saturated": int(0.8 * given["nodes"])},
        {"saturated": 20, "in range": 20, "reset": 5, "idle": 20},
    )
