"""Reference of ``goal_holder``, clock by clock: when the guard gets a sequence's goals.

It keeps the clock of the last goal where the RTL has a register of one bit, and goals by leg.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class GoalHolder:
    """Goals of three two-level legs."""

    now: int = 0  # Number of the clock; one more each time
    # Of a, b, c: 1 upper gate, 0 lower gate.
    goals: list[int] = field(default_factory=lambda: [0, 0, 0])
    given_at: int = -1  # Clock in which the guard sees them as new, the latest
    owed: bool = False  # Whether a sequence has begun that the guard has not been told of

    @property
    def decided(self) -> bool:
        """Whether the goals are new in this clock."""
        return self.given_at == self.now

    @property
    def goal(self) -> int:
        """Goals that the guard has been given, bit 2: a; the port has them a clock earlier."""
        a, b, c = self.goals
        return 4 * a + 2 * b + c

    def delayed(self, playing: bool, wanted: int, waits: int) -> bool:
        """Whether a leg's goal is kept in this clock because the leg waits; bit 2: a.

        False in the clock in which the goals are new.
        """
        return playing and not self.decided and (wanted ^ self.goal) & waits != 0

    def clock(self, fresh: bool, playing: bool, wanted: int, waits: int) -> None:
        """One rising edge.

        `wanted`: switch states of the sequence, `waits`: legs that take no other goal, bit 2: a.
        """
        asked = [
            goal if waits >> (2 - x) & 1 else wanted >> (2 - x) & 1
            for x, goal in enumerate(self.goals)
        ]
        told = playing and not self.decided and (self.owed or asked != self.goals)
        self.now += 1
        if told:
            self.goals, self.given_at, self.owed = asked, self.now, False
        if fresh:
            self.owed = True
