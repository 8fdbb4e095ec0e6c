"""What a controller sees in one step, as the words of a board's measurement ports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from directmpc.api.controllers import mpdcc_row, state_of
from directmpc.host.protocol import packed_positions
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.drive import Drive
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc.drive import MptcDrive
from directmpc.states import MpdccState, MptcState, State, StateError


class Encoder:
    """Turns states of a drive into words.

    Parameters
    ----------
    drive : Drive or MptcDrive
        What the board was loaded with.

    Raises
    ------
    ValueError
        If the words cannot represent the drive.
    """

    def __init__(self, drive: Drive | MptcDrive) -> None:
        self.drive = drive
        self._formats = mptc_bit_true.parameters(drive)[1:] if isinstance(drive, MptcDrive) else ()
        # compiled here, and not in the first step, while a watchdog waits for it
        idle: State = MptcState(0j, 0j, 0.0, 0.0, 0.0)
        if isinstance(drive, Drive):
            idle = MpdccState(0j, 0j, 0.0, (0.0, 0.0, 0.0), 0j, 0.0, 0.0, (0, 0, 0))
        self.words(idle)

    def words(self, state: State | Mapping[str, Any]) -> tuple[list[int], bool, int]:
        """Words of a state.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            As the drive's kind is, per unit or SI; or a row of its trace by column names.

        Returns
        -------
        words : list of int
            The core's measurement ports, in port order, in LSB of their formats.
        clipped : bool
            Whether a value lay outside its word and became the nearest.
        position : int
            What is applied until now. MPDCC: s(k-1), packed; MPTC: u, of a sequence the first.

        Raises
        ------
        TypeError
            If it is no state of the drive's kind.
        StateError
            If a value is impossible, or several vectors are applied where the method has one.
        """
        known = state_of(self.drive, state)
        if isinstance(known, MpdccState):
            row = mpdcc_row(self.drive, known)
            words, clipped = common.encode_row(
                row.x_m[0], row.x_inv[0], row.vdc[0], row.iref[0], row.omega_s[0], row.omega_r[0]
            )
            return [int(word) for word in words], bool(clipped), packed_positions(known.applied)
        assert isinstance(self.drive, MptcDrive)
        several = self.drive.control.sequences
        if not several and not isinstance(known.applied, int):
            raise StateError(
                f"applied: got {known.applied}; {self.drive.control.method} applies one vector, "
                "0 to 7"
            )
        first = known.applied if isinstance(known.applied, int) else known.applied[0]
        vdc = self.drive.inverter.vdc if known.vdc is None else known.vdc
        words, clipped = mptc_bit_true.encode_row(
            *self._formats, known.current, known.flux, known.omega_r, vdc,
            known.torque_ref, known.psi_ref,
        )  # fmt: skip
        return [int(word) for word in words], bool(clipped), int(first)
