"""Cocotb side of ``test_common_terms``."""

from __future__ import annotations

import random

import cocotb

from directmpc import formats as f
from directmpc.common_terms import COEFFICIENTS, PROGRAM_LENGTH, SIGNALS
from tb.common import plain
from tb.common.scoreboard import Clock, Scoreboard, arguments, join, number, word

LATENCY = PROGRAM_LENGTH + 5  # clocks from start to done, as the entity's header declares


def operands(rng: random.Random, kind: str) -> dict[str, int]:
    """Operands A: of a measurement, with any 18 bits for the differences, or all most negative."""
    free = {name: word(rng, f.OPERAND_WIDTH) for name in SIGNALS if name not in f.MEASUREMENTS}
    if kind == "lowest":
        lowest = {name: -(1 << 15) * fmt.signed for name, fmt in f.MEASUREMENTS.items()}
        return lowest | dict.fromkeys(free, -(1 << (f.OPERAND_WIDTH - 1)))
    measurement = {
        name: word(rng, fmt.width, signed=fmt.signed) for name, fmt in f.MEASUREMENTS.items()
    }
    return plain.signals_of(measurement) | (free if kind == "any" else {})


@cocotb.test()
async def random_nodes(dut) -> None:  # type: ignore[no-untyped-def]
    """Random operands, some computations cut off by a reset."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    width = f.COEFFICIENT_WIDTH

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
        node = plain.common_terms(signal, speed[0], speed[1], coefficient)
        apply(signal, speed, coefficient)
        dut.start.value = 1
        await clock.tick()
        dut.start.value = 0
        stop = rng.randrange(1, LATENCY) if rng.random() < 0.06 else 0
        for k in range(1, LATENCY):
            board.check("not done yet", number(dut.done), 0, f"clock {k}")
            if k == stop:
                break
            await clock.tick()
        if stop:
            scramble()
            await clock.reset(1)
            for _ in range(LATENCY + 2):
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
