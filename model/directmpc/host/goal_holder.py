"""Reference of ``goal_holder``, clock by clock: when the guard gets a sequence's goals.

It keeps the clock of the last goal where the RTL has a register of one bit, and goals by leg.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class GoalHolder:
    """Goals of three two-level legs.

    Attributes
    ----------
    now : int
        Number of the clock; one more each time.
    goals : list of int
        Of a, b, c: 1 upper gate, 0 lower gate.
    given_at : int
        Clock in which the guard sees them as new, the latest.
    owed : bool
        Whether a sequence has begun that the guard has not been told of.
    """

    now: int = 0
    goals: list[int] = field(default_factory=lambda: [0, 0, 0])
    given_at: int = -1
    owed: bool = False

    @property
    def decided(self) -> bool:
        """Whether the goals are new in this clock.

        Returns
        -------
        bool
            As the port has it.
        """
        return self.given_at == self.now

    @property
    def goal(self) -> int:
        """Goals that the guard has been given; the port has them a clock before `decided`.

        Returns
        -------
        int
            Bit 2: a, 1: b, 0: c.
        """
        a, b, c = self.goals
        return 4 * a + 2 * b + c

    def delayed(self, playing: bool, wanted: int, waits: int) -> bool:
        """Whether a leg's goal is kept in this clock because the leg waits.

        Parameters
        ----------
        playing : bool
            Whether there is a sequence.
        wanted : int
            Switch states that it asks for, bit 2: a.
        waits : int
            Legs that take no other goal, bit 2: a.

        Returns
        -------
        bool
            False in the clock in which the goals are new.
        """
        return playing and not self.decided and (wanted ^ self.goal) & waits != 0

    def clock(self, fresh: bool, playing: bool, wanted: int, waits: int) -> None:
        """One rising edge.

        Parameters
        ----------
        fresh : bool
            Whether a new sequence begins.
        playing : bool
            Whether there is a sequence.
        wanted : int
            Switch states that it asks for, bit 2: a.
        waits : int
            Legs that take no other goal, bit 2: a.
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
