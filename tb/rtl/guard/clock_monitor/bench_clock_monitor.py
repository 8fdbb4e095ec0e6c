"""Cocotb side of ``test_clock_monitor``."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Scoreboard, arguments, number


class Clocks:
    """Two clocks that have nothing to do with each other, in picoseconds."""

    def __init__(self, dut, reference: int) -> None:
        self.dut, self.reference = dut, reference
        self.now = 0
        self.at = {"clk": 0, "oscillator": 0}  # next change
        self.level = {"clk": 0, "oscillator": 0}
        self.beats = 0  # rising edges of the watched clock
        dut.clk.value = dut.oscillator.value = 0

    async def _change(self, period: int | None) -> str:
        """The next change of a clock, the watched one with a period or standing; its name."""
        names = ["oscillator"] if period is None else ["oscillator", "clk"]
        name = min(names, key=self.at.__getitem__)
        if self.at[name] > self.now:
            await Timer(self.at[name] - self.now, "ps")
            self.now = self.at[name]
        self.level[name] ^= 1
        getattr(self.dut, name).value = self.level[name]
        half = (self.reference if name == "oscillator" else period) // 2
        self.at[name] = self.now + half
        self.beats += self.level[name] if name == "clk" else 0
        return name

    async def run(self, period: int | None, edges: int) -> int:
        """So many rising edges of the reference; how many of them saw ``alive``."""
        seen = 0
        self.at["clk"] = max(self.at["clk"], self.now)
        while edges:
            name = await self._change(period)
            if name == "oscillator" and self.level[name]:
                await Timer(1, "ps")
                self.now += 1
                edges -= 1
                seen += number(self.dut.alive)
        return seen

    async def beat(self, period: int, beats: int) -> None:
        """Until the watched clock has risen so often since the start."""
        self.at["clk"] = max(self.at["clk"], self.now)
        while self.beats < beats:
            await self._change(period)


@cocotb.test()
async def clocks_of_any_speed(dut) -> None:
    """The watched clock at random speeds, and standing; each for long enough to be judged."""
    given = arguments()
    shortest, longest = given["SHORTEST"], given["LONGEST"]
    half = 2 ** given["DIVIDE_BITS"]
    rng = random.Random(given["seed"])
    board, clocks = Scoreboard(), Clocks(dut, 20_000)
    settled = longest + 4
    await clocks.run(None, 3)
    board.check("standing from the start", await clocks.run(None, 3 * settled), 0)

    def period_of(apart: float) -> int:
        """Period of a watched clock whose divided clock changes every so many reference clocks."""
        return 2 * round(apart * clocks.reference / half / 2)

    # two changes of the divided clock have to be seen
    period, waited = period_of((shortest + longest) / 2), 0
    while await clocks.run(period, 1) == 0 and waited < 4 * longest:
        waited += 1
    board.check("alive at first", clocks.beats // half, 2, f"after {clocks.beats} edges")
    for n in range(given["phases"]):
        # how many reference clocks two changes of the divided clock lie apart
        kind = rng.choice(["fits", "fits", "slow", "fast", "stands"])
        low, high = {
            "fits": (shortest + 1.0, longest - 1.0),
            "slow": (longest + 1.0, 3.0 * longest),
            "fast": (0.2 * shortest, shortest - 1.0),
            "stands": (0.0, 0.0),
        }[kind]
        apart = rng.uniform(low, high)
        period = None if kind == "stands" else period_of(apart)
        await clocks.run(period, max(settled, round(3 * apart) + 5))
        seen = await clocks.run(period, 4 * longest)
        board.check("alive", seen, 4 * longest * (kind == "fits"), f"{n}: {kind}, {apart:.2f}")
        board.cover(kind)
    # both ends of the window: changes that are whole reference clocks apart
    for apart, fits in (
        (shortest - 1, 0), (shortest, 1), (longest, 1), (longest + 1, 0),
    ):  # fmt: skip
        await clocks.run(period_of(apart), 4 * longest)
        seen = await clocks.run(period_of(apart), 2 * longest)
        board.check("end of the window", seen, 2 * longest * fits, apart)
    # alive until then, and off in time once the clock stands behind a change of the divided clock
    period = period_of((shortest + longest) / 2)
    for n in range(20):
        await clocks.run(period, 4 * longest + rng.randrange(longest))
        board.check("alive before", await clocks.run(period, 1), 1, n)
        await clocks.beat(period, half * (clocks.beats // half + 1))
        seen = await clocks.run(None, longest + 10)
        board.check("stops", seen, longest + 3, n)
    board.finish({"alive": given["phases"]}, dict.fromkeys(("fits", "slow", "fast", "stands"), 3))
