"""Safe torque off of two channels, clock by clock: what `safe_torque_off.vhd` is compared with.

It tells from what each channel was in the last clocks, where the circuit counts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

#: Flip-flops between a channel and its filter.
STAGES = 2


class SafeTorqueOff:
    """Two channels that release a drive together.

    Clocks of the filter and of the discrepancy, which has to be longer (ValueError).
    """

    def __init__(self, filter_clocks: int, discrepancy: int) -> None:
        if not 1 <= filter_clocks < discrepancy:
            raise ValueError(f"filter: 1 to {discrepancy - 1} clocks, not {filter_clocks}")
        self._discrepancy = discrepancy
        self._passing = deque([(0, 0)] * STAGES, STAGES)
        self._seen = [deque([0] * filter_clocks, filter_clocks) for _ in range(2)]
        self._reset()

    def _reset(self) -> None:
        """What a reset does: both channels count as off."""
        self.counted = [0, 0]
        self.permit = self.fault = 0
        self._alone: deque[bool] = deque([False] * self._discrepancy, self._discrepancy)
        self._rested = True
        for seen in self._seen:
            seen.extend([0] * len(seen))

    def clock(self, channels: Sequence[int], *, clear: bool = False, rst: bool = False) -> None:
        """One rising edge; `permit` and `fault` are what follows it.

        `channels`: 1 allows torque; `clear` lets the fault go if both are off.
        """
        levels = self._passing[0]
        self._passing.append((channels[0], channels[1]))
        if rst:
            self._reset()
            return
        self._alone.append(self.counted[0] != self.counted[1])
        if clear and self.counted == [0, 0]:
            self.fault = 0
        if all(self._alone):
            self.fault = 1
        released = self.permit
        for seen, level, i in zip(self._seen, levels, range(2), strict=True):
            seen.append(level)
            if len(set(seen)) == 1:
                self.counted[i] = level
        if self.counted == [0, 0]:
            self._rested = True
        elif released and self.counted != [1, 1]:
            self._rested = False
        self.permit = int(self.counted == [1, 1] and self._rested and not self.fault)
