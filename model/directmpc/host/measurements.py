"""What a controller sees in one step, as the words of a board's measurement ports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from directmpc.api.controllers import state_of
from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.host.protocol import packed_positions
from directmpc.states import State


class Encoder:
    """Turns states of a drive into words; ValueError if they cannot represent the drive."""

    def __init__(self, drive: AnyDrive) -> None:
        self.drive = drive
        kind = kind_of(drive)
        self._encode = kind.encoder(drive)
        self.words(kind.idle)  # compiled here, and not in the first step while a watchdog waits

    def words(self, state: State | Mapping[str, Any]) -> tuple[list[int], bool, int]:
        """Words of a state or a row of its trace, whether one was clipped, and what is applied.

        The core's ports in order, in LSB; s(k-1) packed, MPTC: u, of a sequence the first.
        TypeError or StateError for what is no state of the drive.
        """
        words, applied, clipped = self._encode(state_of(self.drive, state))
        position = applied["u"] if "u" in applied else packed_positions(tuple(applied.values()))
        return list(words.values()), clipped, int(position)
