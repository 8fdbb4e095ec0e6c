"""Cocotb side of ``test_fabric``: converters' words in, gates out, no host."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, Timer

from directmpc.api.drive_file import load_drive
from directmpc.mpdcc import coefficients
from directmpc.mpdcc import observer as rotor_flux_observer
from directmpc.mpdcc.bit_true import common, fast
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.formats import MEASUREMENTS
from directmpc.mpdcc.plant import Plant
from tb.helpers.scoreboard import Scoreboard, arguments, bits, number

PERIOD = 5_000  # clocks of a control period
INPUTS = ("adc_i_a", "adc_i_b", "adc_v_n", "adc_v_a", "adc_v_b", "adc_v_c", "adc_v_dc")
#: Measurement, span and middle of each converter.
CONVERTERS = (
    ("is_alpha", 4.0, 2048), ("is_alpha", 4.0, 2048), ("v_n", 0.5, 2048), ("v_ph_a", 1.0, 0),
    ("v_ph_a", 1.0, 0), ("v_ph_a", 1.0, 0), ("v_dc", 4.0, 0),
)  # fmt: skip


def converted(values: np.ndarray) -> list[int]:
    """Words of ideal converters of 12 bits."""
    found = []
    for value, (_, span, middle) in zip(values, CONVERTERS, strict=True):
        found.append(int(np.clip(round(value / span * 4096) + middle, 0, 4095)))
    return found


def scaled(adc: list[int]) -> list[int]:
    """What the cores measure, word for word: offset, gain, Clarke."""
    found = []
    for word, (name, span, middle) in zip(adc, CONVERTERS, strict=True):
        gain = round(float(MEASUREMENTS[name].scale) * span / 4096 * 256)
        low = 0 if middle == 0 else -(2**15)
        value = ((word - middle) * gain + 128) >> 8
        found.append(min(max(value, low), low + 2**16 - 1))
    a, b, *others = found
    beta = ((a + 2 * b) * 18919 + 2**14) >> 15
    return [a, min(max(beta, -(2**15)), 2**15 - 1), *others]


class Rig:
    """The clock, and what happens between two ticks."""

    def __init__(self, dut) -> None:
        self.dut, self.running, self.now = dut, True, 0

    async def clock(self) -> None:
        """The clock, until the test ends."""
        while self.running:
            self.dut.clk.value = 0
            await Timer(5, "ns")
            self.dut.clk.value = 1
            self.now += 1
            await Timer(5, "ns")

    async def begin(self) -> None:
        """Known inputs, a reset."""
        for name in (*INPUTS, "tick", "iref_alpha", "iref_beta", "omega_s", "omega_r"):
            getattr(self.dut, name).value = 0
        self.dut.permit.value, self.dut.rst.value = 1, 1
        cocotb.start_soon(self.clock())
        for _ in range(5):
            await FallingEdge(self.dut.clk)
        self.dut.rst.value = 0

    async def tick(self, longest: int) -> int | None:
        """A tick; clocks until the decision is there, None if none comes."""
        dut = self.dut
        dut.tick.value = 1
        await FallingEdge(dut.clk)
        dut.tick.value = 0
        for name in INPUTS:
            getattr(dut, name).value = 0
        for clocks in range(longest):
            if number(dut.valid):
                return clocks + 1
            await FallingEdge(dut.clk)
        return None


@cocotb.test()
async def boot_and_decide(dut) -> None:
    """Nothing before the boot is over; then a closed loop, and permit taken away."""
    given, board, rig = arguments(), Scoreboard(), Rig(dut)
    drive = load_drive(given["drive"])
    await rig.begin()
    begun = rig.now
    for _ in range(4):
        board.check("early", await rig.tick(100), None, "no decision before the boot is over")
        board.check("pins", number(dut.pins), 0, "before the boot is over")
    while not (number(dut.booted) or number(dut.failed)):
        await FallingEdge(dut.clk)
        assert rig.now - begun < 100_000, "the boot does not end"
    board.check(
        "booted", (number(dut.booted), number(dut.failed)), (1 - given["fails"], given["fails"])
    )
    board.longest("boot", rig.now - begun)
    if given["fails"]:
        for _ in range(4):
            board.check("early", await rig.tick(500), None, "no decision after a failure")
            board.check("pins", number(dut.pins), 0, "after a failure")
        rig.running = False
        board.finish({"early": 8, "pins": 8})
        return
    register = coefficients.registers(drive, "fast").array()
    observer = rotor_flux_observer.array(rotor_flux_observer.coefficients(drive)[0])
    estimate = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
    profile = constant_profile(drive, OperatingPoint(0.3), given["steps"] + 1)
    state, _ = initial_conditions(profile)
    plant = Plant(drive, float(profile.omega_r[0]), state=state)
    applied = np.zeros(3, dtype=np.int64)  # own positions after a reset
    for k in range(given["steps"]):
        next_tick = rig.now + PERIOD
        x = plant.state
        i_b = -0.5 * x[0] + 0.5 * np.sqrt(3.0) * x[1]
        adc = converted(np.array([x[0], i_b, x[4], *x[5:8], profile.vdc[k]]))
        words, _ = common.encode_row(
            x[:4], x[4:], profile.vdc[k],
            np.array([profile.iref[k].real, profile.iref[k].imag]),
            profile.omega_s[k], plant.omega_r,
        )  # fmt: skip
        words[[0, 1, 4, 5, 6, 7, 8]] = scaled(adc)
        for name, word in zip(INPUTS, adc, strict=True):
            getattr(dut, name).value = word
        for name, place in (("iref_alpha", 9), ("iref_beta", 10), ("omega_s", 11), ("omega_r", 12)):
            getattr(dut, name).value = bits(int(words[place]), 16)
        seen = words[[0, 1, 4, 5, 6, 7, 8, 12]]
        flux = rotor_flux_observer.step_words(observer, estimate, seen, applied)[:2]
        words[2:4] = flux
        wanted = tuple(int(v) for v in fast.decide_words(register, words, applied))[:3]
        clocks = await rig.tick(500)
        assert clocks is not None, "no decision"
        board.longest("clocks", clocks)
        got = tuple(number(getattr(dut, f"s_{phase}")) for phase in "abc")
        board.check("decision", got, wanted, f"step {k}")
        await FallingEdge(dut.clk)
        got_flux = [number(dut.flux_alpha), number(dut.flux_beta)]
        board.check("flux", got_flux, [bits(int(v), 16) for v in flux], f"step {k}")
        board.check("faults", number(dut.faults), 0, f"step {k}")
        applied = np.array(wanted, dtype=np.int64)
        plant.step(wanted)
        while rig.now < next_tick:
            await FallingEdge(dut.clk)
        board.cover("on", int(number(dut.pins) != 0))
    dut.permit.value = 0
    await Timer(1, "ns")  # no edge of the clock
    board.check("pins", number(dut.pins), 0, "not permitted")
    rig.running = False
    board.finish({"decision": given["steps"], "flux": given["steps"]}, {"on": given["steps"] - 1})
