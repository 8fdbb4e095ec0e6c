"""A board behind a link: a drive is loaded, started, stepped and stopped; registers, counters.

A host:

    with Board("/dev/ttyUSB0") as board:
        board.load(drive)
        board.start()
        while running:
            reply = board.step(measured())
            apply(reply.apply)

`measured` and `apply` are the host's own. However the block is left, the drive is turned off.
"""

from __future__ import annotations

import difflib
import os
import struct
import time
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from types import TracebackType
from typing import Any, Self

import numpy as np

from directmpc.api.controllers import state_of
from directmpc.api.drive_file import AnyDrive, load_drive
from directmpc.drive_tables import DriveError
from directmpc.host import protocol as p
from directmpc.host import rtl, spi
from directmpc.host.console import terminable, undisturbed
from directmpc.host.joined import JoinedLink
from directmpc.host.link import Link, LinkError, RefusedError, SerialStream
from directmpc.host.measurements import Encoder
from directmpc.host.protocol import Controller, Decision, Flag, Identity, Outcome, Type
from directmpc.host.recorder import (
    RESULTS_AT,
    STRIDE,
    RecorderStatus,
    Recording,
    Settings,
    unpack,
)
from directmpc.host.recorder import words as record_words
from directmpc.host.registers import (
    RegisterValues,
    limits,
    packed,
    refuse_short,
    refuse_slow,
    registers_of,
    values,
)
from directmpc.mpdcc.formats import BOUND_HIGH
from directmpc.mpdcc.tables import NAMES
from directmpc.mptc.sequence import TIME_STEPS
from directmpc.states import (
    MpdccDecision,
    MptcDecision,
    State,
    StateError,
    VectorSequence,
    ramped,
)

BAUD = 3_000_000
"""Bit rate of the boards' UART, 1/s."""

SPI = "spi:"
"""What the name of a port behind SPI begins with."""

RTL = "rtl:"
"""What the name of a board begins with that is the RTL itself, in this process."""

SCOPE = "scope:"
"""What the name of a board begins with that a scope owns."""

LONGEST_TIME = 0xFFFF
"""Of the guard's decision limit and watchdog, clocks: lock-step knows no control period."""

_STOP_ATTEMPTS = 5

#: Reads of the status within which a commit has come into force.
_COMMIT_READS = 50

#: Steps after a start within which the gates have come on, or the host looks why they have not.
_STEPS_TO_RUN = 4

_RESPONSES = {
    2: "there is no such register, or not for that access, or it is locked now (docs/registers.md)",
    3: "beyond the registers",
}


#: Registers that a board without the option takes and ignores, and the capability they need.
_NEEDED = {
    "control.use_observer": "observer",
    "parameters.two_switchings": "second_level",
    "parameters.compensate": "second_level",
    "parameters.deadlock_rule": "weighted_deadlock",
    "parameters.outside_inwards": "inwards",
    "parameters.f_q_midpoint": "capacitor_filter",
    "parameters.f_q_phase": "capacitor_filter",
    "parameters.l_mode": "leakage_estimate",
    "parameters.method_mpfc": "flux_control",
    "parameters.family_method": "family",
    "parameters.duty_rule": "family",
    "parameters.sensorless": "sensorless",
}


class RegisterError(RuntimeError):
    """A register cannot be read or written."""


class TrippedError(RuntimeError):
    """The gate guard holds a fault: all gates are off.

    `faults` are those that came first (docs/gate-guard.md); later ones are not latched.
    """

    def __init__(self, faults: tuple[str, ...], when: str) -> None:
        hint = ""
        if "capacitor" in faults:
            hint = (
                "; before a start, charge every phase capacitor to its share of the dc link, "
                "between guard.v_ph_low and guard.v_ph_high (docs/safety.md)"
            )
        super().__init__(
            f"{when}: the gate guard has tripped ({', '.join(faults)}), all gates are off{hint}; "
            "see docs/troubleshooting.md"
        )
        self.faults = faults


class DisabledError(RuntimeError):
    """A drive that was started is off, and no fault says why: all gates are off."""


@dataclass(frozen=True)
class Reply:
    """What a board says to one step."""

    decision: MpdccDecision | MptcDecision  # What it decided
    cycles: int  # Clocks that the decision took
    gates: int  # Gate signals at the time of the reply, one bit each
    running: bool  # Whether the gate guard lets the gates switch
    exhausted: bool  # Whether SESE's budget ended the search

    @property
    def apply(self) -> tuple[int, int, int] | int | VectorSequence:
        """What to apply: MPDCC's positions from now on, MPTC's vector from the next step on."""
        return self.decision.apply


def decision_of(
    controller: str, answer: Decision, clipped: bool, sequence: VectorSequence | None = None
) -> MpdccDecision | MptcDecision:
    """The decision in a reply to STEP; `saturated` also where a measurement was clipped.

    `sequence` is what was decided where it is more than one vector: the reply has no room for it.
    """
    saturated = answer.has(Flag.SATURATED) or clipped
    if controller == "mptc":
        apply = answer.position & 7 if sequence is None else sequence
        return MptcDecision(apply, saturated, answer.has(Flag.CLAMPED))
    held, deadlock = answer.has(Flag.HELD), answer.has(Flag.DEADLOCK)
    return MpdccDecision(answer.positions, held, deadlock, answer.length, saturated)


def _stream_of(port: str, rate: int | None) -> SerialStream | spi.SpiStream:
    """The line to a board, by the port's name."""
    if port.startswith(RTL):
        return spi.SpiStream(rtl.Device(port.removeprefix(RTL)))
    if port.startswith(SPI):
        return spi.opened(port.removeprefix(SPI), spi.RATE if rate is None else rate)
    return SerialStream(port, BAUD if rate is None else rate)


class Board:
    """A board that has identified itself.

    As a context it turns off the drive that it has started, and closes the line, however the block
    is left: at its end, by an exception, by Ctrl-C, by any signal that ends programs. Against
    SIGKILL, a crash of the interpreter and a dead computer there is the gate guard's watchdog.

    Parameters
    ----------
    port : str, path or Link
        Serial device, or name of a virtual board; ``spi:`` before an SPI device of Linux, or before
        the name of a virtual board with SPI; ``rtl:``, ``rtl:mptc`` or ``rtl:`` and a drive: the
        board's RTL itself, see `directmpc.host.rtl`; ``scope:`` and the address of a scope that
        owns the board; or a link of one's own.
    real_time : bool
        False, lock-step: the board waits for the host, `load` sets the guard's decision limit and
        watchdog to their longest, 65,535 clocks. True: they follow from the control period.
    baud : int, optional
        Bit rate, 1/s: 3,000,000 by default, and 10,000,000 over SPI.
    timeout : float
        Seconds to wait for a reply.

    Attributes
    ----------
    link : Link
        How it is reached.
    identity : Identity
        Who it is.
    drive : Drive, KbestDrive, MptcDrive or None
        What it has been loaded with.

    Raises
    ------
    LinkError
        If the port cannot be opened, no board answers, or one with another version of the protocol.
    """

    def __init__(
        self,
        port: str | os.PathLike[str] | Link,
        *,
        real_time: bool = False,
        baud: int | None = None,
        timeout: float = 2.0,
    ) -> None:
        self._context, self._stream = ExitStack(), None
        if isinstance(port, Link):
            self.link = port
        elif os.fspath(port).startswith(SCOPE):
            self.link = JoinedLink(os.fspath(port).removeprefix(SCOPE), timeout)
        else:
            self._stream = _stream_of(os.fspath(port), baud)
        try:
            if self._stream is not None:
                self.link = Link(self._stream, timeout)
            self._identify()
        except BaseException:
            self._close()
            raise
        self.real_time = real_time
        self.drive: AnyDrive | None = None
        self._encoder: Encoder | None = None
        self._count = 0
        self._started = False
        #: Steps since the start without gates; None once they have been on.
        self._waited: int | None = 0
        #: Keys that the drive file lacks, and without which no gate may come on.
        self._missing: list[str] = []
        #: What stays in system.control: bits of a drive whose sequences or speed are the board's.
        self._kept: dict[str, int] = {"own_positions": 0}

    def __enter__(self) -> Self:
        self._context.enter_context(terminable())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._started:
                self.stop()
        finally:
            self._close()
            self._context.close()

    def _close(self) -> None:
        if self._stream is not None:
            self._stream.close()

    def _identify(self) -> None:
        link = self.link
        self.identity = Identity.unpack(link.request(Type.IDENTIFY))
        if self.identity.version != p.VERSION:
            raise LinkError(
                f"the board speaks version {self.identity.version} of the protocol, this program "
                f"version {p.VERSION}"
            )
        link.sequence = self.identity.last_sequence
        self._map = registers_of(self.controller)

    @property
    def controller(self) -> str:
        """As drive files write it.

        Returns
        -------
        str
            "mpdcc", "kbest" or "mptc".
        """
        return self.identity.controller.name.lower()

    def read_word(self, address: int) -> int:
        """A register's word.

        Parameters
        ----------
        address : int
            Byte address, a multiple of 4.

        Returns
        -------
        int
            32 bits, unsigned.

        Raises
        ------
        LinkError
            If the board does not answer.
        RegisterError
            If there is no such register to read.
        """
        _, response, word = struct.unpack(
            "<HBI", self.link.request(Type.READ, struct.pack("<H", address))
        )
        if response:
            raise RegisterError(f"read of 0x{address:03X}: {_RESPONSES.get(response, response)}")
        return int(word)

    def write_word(self, address: int, word: int) -> None:
        """Write a register's word.

        Parameters
        ----------
        address : int
            Byte address, a multiple of 4.
        word : int
            32 bits, unsigned.

        Raises
        ------
        LinkError
            If the board does not answer.
        RegisterError
            If it is no word of 32 bits (nothing is sent then), or there is no such register to
            write.
        """
        if not 0 <= word < 1 << 32:
            raise RegisterError(f"write to 0x{address:03X}: {word} is not a word of 32 bits")
        _, response = struct.unpack(
            "<HB", self.link.request(Type.WRITE, struct.pack("<HI", address, word))
        )
        if response:
            raise RegisterError(f"write to 0x{address:03X}: {_RESPONSES.get(response, response)}")

    def read(self, name: str) -> dict[str, int]:
        """Fields of a register, signed where they are.

        Parameters
        ----------
        name : str
            Name of a register as in docs/registers.md.

        Returns
        -------
        dict of str to int
            Field to value, in the format that docs/registers.md gives.

        Raises
        ------
        RegisterError
            If there is no such register, or it cannot be read.
        """
        address, fields = self._register(name)
        try:
            word = self.read_word(address)
        except RegisterError as error:
            raise RegisterError(f"{name}: {error}") from None
        found = {}
        for field, (low, width, signed) in fields.items():
            value = word >> low & (1 << width) - 1
            found[field] = value - (1 << width) if signed and value >> (width - 1) else value
        return found

    def write(self, name: str, **values: int) -> None:
        """Write fields of a register; those not given are written as 0.

        Parameters
        ----------
        name : str
            Name of a register as in docs/registers.md.
        **values : int
            Field to value, signed where the field is.

        Raises
        ------
        RegisterError
            If there is no such register or field, a value does not fit its field, or the board was
            built without what it asks for; nothing is sent then. If it cannot be written.
        """
        address, fields = self._register(name)
        for field, value in values.items():
            least, most = self.limits(name, field)
            if not least <= value <= most:
                raise RegisterError(
                    f"{name}: {field} = {value} does not fit; it must be an integer from {least} "
                    f"to {most}"
                )
        if values.get("use_observer"):
            self._check_built(["control.use_observer"])
        try:
            self.write_word(address, packed(name, fields, values))
        except RegisterError as error:
            raise RegisterError(f"{name}: {error}") from None

    def limits(self, name: str, field: str) -> tuple[int, int]:
        """Least and largest value that a field takes.

        Parameters
        ----------
        name : str
            Name of a register as in docs/registers.md.
        field : str
            Name of the field.

        Returns
        -------
        least, most : int
            Signed where the field is. Bounds end where the sums of the board's explorers do.

        Raises
        ------
        RegisterError
            If there is no such register or field.
        """
        _, fields = self._register(name)
        if field not in fields:
            raise RegisterError(f"{name}: no field '{field}'; it has {', '.join(fields)}")
        least, most = limits(name, field, fields[field])
        if name.startswith("parameters.bound_"):
            most = BOUND_HIGH[self.variant]
        return least, most

    def _register(self, name: str) -> tuple[int, dict[str, tuple[int, int, bool]]]:
        """Address and fields of a register."""
        if name not in self._map:
            near = difflib.get_close_matches(name, self._map, 3)
            meant = f"; {' or '.join(near)} is near" if near else ""
            raise RegisterError(f"no register '{name}'{meant}; docs/registers.md lists them")
        return self._map[name]

    @property
    def variant(self) -> str:
        """Which explorers MPDCC has.

        Returns
        -------
        str
            "paper" or "fast"; "fast" for MPTC.
        """
        return "paper" if self.is_mpdcc() and self.identity.options & 1 else "fast"

    def values(
        self,
        drive: AnyDrive,
        *,
        sensorless: bool = False,
    ) -> RegisterValues:
        """Register values of a drive for this board: its clock, its explorers, how it keeps time.

        Parameters
        ----------
        drive : Drive, KbestDrive or MptcDrive
            As loaded from a file.
        sensorless : bool
            Whether the board estimates the speed, and the flux with it; two-level drives alone.

        Returns
        -------
        RegisterValues
            In lock-step with the longest decision limit and watchdog, unless the drive file has
            its own.

        Raises
        ------
        ValueError
            As `registers.values`.
        """
        capabilities = self.read("system.capabilities")
        found = values(
            drive,
            self.variant,
            clock=float(self.identity.clock),
            built=[name for name in ("family", "sensorless") if capabilities[name]],
            sensorless=sensorless,
        )
        if not self.real_time:
            for name in ("decision_limit", "watchdog"):  # what the file asks for is never loosened
                if getattr(drive.guard, name) is None:
                    found.words[f"guard.{name}"] = LONGEST_TIME
        return found

    def load(
        self,
        drive: AnyDrive | str | os.PathLike[str] | RegisterValues,
        *,
        sensorless: bool = False,
    ) -> int:
        """Turn the gates off, write a drive's registers, commit them and read them back.

        Parameters
        ----------
        drive : Drive, KbestDrive, MptcDrive, str, path or RegisterValues
            A drive, the path of its file, the name of a shipped one; or values of one's own, which
            are written as they are, and for which `step` knows no units.
        sensorless : bool
            As of `values`; not with values of one's own.

        Returns
        -------
        int
            How many registers were written, the commit included.

        Raises
        ------
        LinkError
            If the board does not answer, or the drive is for the other controller or the values for
            another clock.
        RegisterError
            If it asks for what was not built into this board, or a value does not fit its register;
            nothing is written then. If a register does not keep what was written, or the guard's
            settings do not come into force.
        ValueError
            If the drive cannot be used; the message names the key. In real time also if a decision
            can outlast the guard's decision limit, or a leg's move the control period, as of
            `registers.refuse_slow` and `refuse_short`.

        Warns
        -----
        UserWarning
            For each value that does not fit its register and became a safer one.
        """
        if isinstance(drive, RegisterValues):
            found, self.drive, self._encoder = drive, None, None
        else:
            known = drive if hasattr(drive, "controller") else load_drive(drive)
            self._check_controller(known.controller)
            self._check_converter(known)
            found = self.values(known, sensorless=sensorless)
            if self.real_time:
                refuse_slow(known, found, self.variant, max(self.identity.explorers, 1))
                refuse_short(known)
            for sentence in found.saturated:
                warnings.warn(sentence, stacklevel=2)
            self.drive, self._encoder = known, Encoder(known)
        self._check_controller(found.controller)
        if found.clock != self.identity.clock:
            raise LinkError(
                f"the values are for a clock of {found.clock / 1e6:g} MHz, the board has "
                f"{self.identity.clock / 1e6:g} MHz"
            )
        self._check_built(name for name, word in found.words.items() if word)
        if found.search:
            known = self.read("result.search")
            if lacking := [f"{n} {v}" for n, v in found.search.items() if known[n] != v]:
                has = " and ".join(f"{n} {known[n]}" for n in found.search)
                raise RegisterError(
                    f"the drive asks for {' and '.join(lacking)}, this board was built for {has}"
                )
        try:
            writes = found.writes()
        except ValueError as error:
            raise RegisterError(str(error)) from None
        # a sequence has no room in a step: the board goes by its own
        self._kept = {"own_positions": int(found.words.get("parameters.family_method", 0) > 0)}
        if found.words.get("parameters.sensorless"):
            self._kept["use_observer"] = 1
        self._missing = list(found.missing)
        self.stop()
        for _, address, word in writes:
            self.write_word(address, word)
        if differing := self.differing(found):
            raise RegisterError(f"{', '.join(differing)} did not keep what was written")
        self.await_commit()
        return len(writes)

    def await_commit(self) -> None:
        """Wait until what was committed is in force: a decision that is under way ends before.

        Raises
        ------
        LinkError
            If the board does not answer.
        RegisterError
            If the guard's settings do not come into force.
        """
        for _ in range(_COMMIT_READS):
            status = self.read("system.status")
            if not status["commit_pending"]:
                break
        if status["commit_pending"] or not status["in_force"]:
            raise RegisterError("the guard's settings did not come into force")

    def _check_built(self, wanted: Iterable[str]) -> None:
        built = self.read("system.capabilities")
        for name in wanted:
            if name in _NEEDED and not built[_NEEDED[name]]:
                raise RegisterError(
                    f"{name} is set, which this board ignores: its capabilities lack "
                    f"{_NEEDED[name]}"
                )

    def _check_controller(self, controller: str) -> None:
        if controller != self.controller:
            raise LinkError(f"the drive file is for {controller}, the board has {self.controller}")

    def _check_converter(self, drive: AnyDrive) -> None:
        if hasattr(drive, "converter"):
            number = self.read("system.gates")["converter"]
            built = NAMES[number] if number < len(NAMES) else f"number {number}"
            if drive.inverter.topology != built:
                raise LinkError(
                    f"the drive file is for the converter {drive.inverter.topology}, the board has "
                    f"gates for {built}"
                )

    def start(self) -> tuple[str, ...]:
        """Clear the faults and let the gates switch; they follow the decisions from now on.

        The drive's capacitor filters, its observer, its estimate of the leakage, its plan and its
        own sequence begin anew: nobody knows how long ago the last step was.

        Returns
        -------
        tuple of str
            Names of the faults that were latched until now and have been cleared.

        Raises
        ------
        LinkError
            If the board does not answer.
        DriveError
            If the drive file lacks keys of `[guard]`; names all of them and what is allowed.
        TrippedError
            If a fault is latched again at once: permit is missing, for instance.

        Warns
        -----
        UserWarning
            If faults have been cleared; it names them.
        """
        self.stop()
        if self._missing:
            raise DriveError(f"start: {'; '.join(self._missing)}")
        latched = self.read("system.faults")
        self.write("system.faults", **latched)
        cleared = tuple(name for name, value in latched.items() if value)
        if cleared:
            warnings.warn(
                f"start: clears the faults {', '.join(cleared)}, which were latched before; their "
                "cause has to be known",
                stacklevel=2,
            )
        control = getattr(self.drive, "control", None)
        remembers = any(getattr(control, k, 0) for k in ("capacitor_filter", "leakage_estimate"))
        remembers = remembers or self.identity.controller is Controller.KBEST  # its plan
        if remembers or self._kept["own_positions"] or self._kept.get("use_observer"):
            self.forget_estimates()
        self._started, self._waited = True, 0  # from here on there is something to turn off
        self.write("system.control", enable=1, **self._kept)
        if self.read("system.status")["fault"]:
            faults = self.faults()
            self.stop()
            raise TrippedError(faults, "start")
        return cleared

    def forget_estimates(self) -> None:
        """Let capacitor filters, observer and estimate begin anew with the next step.

        While the gates are off, the system's own sequence does so too: no voltage is applied.

        Raises
        ------
        LinkError
            If the board does not answer.
        """
        self.write("system.command", reset_observer=1)

    def stop(self) -> None:
        """Turn all gates off, whatever state the board is in, and whichever link is in control.

        A signal that comes meanwhile, a second Ctrl-C for instance, waits until it is done.

        Raises
        ------
        LinkError
            If the board does not answer; then its watchdog turns them off.
        RefusedError
            If it refuses again and again.
        """
        address, fields = self._map["system.control"]
        kept = packed("system.control", fields, self._kept)
        with undisturbed():
            for attempt in range(1, _STOP_ATTEMPTS + 1):
                try:
                    self.write_word(address, 0)  # the word that either link may write
                except RefusedError as refused:  # a step whose reply nobody waited for
                    if refused.outcome is not Outcome.BUSY or attempt == _STOP_ATTEMPTS:
                        raise
                    time.sleep(0.001)
                except LinkError as error:
                    raise LinkError(
                        f"the gates could not be turned off: {error}; the watchdog of a board does "
                        "it"
                    ) from error
                else:
                    break
            self._started = False
            if kept:  # for steps without gates; the gates are off already
                try:
                    self.write_word(address, kept)
                except RefusedError as refused:
                    if refused.outcome is not Outcome.LINK:
                        raise

    def ramp_down(
        self, measure: Callable[[Reply | None], State | Mapping[str, Any]], steps: int
    ) -> None:
        """Bring the reference to zero in so many steps, then turn all gates off.

        This is the safe stop 1 (SS1) of IEC 61800-5-2. The reference falls in equal parts: the
        current of MPDCC, the torque of MPTC. Whatever happens on the way, the gates go off.

        Parameters
        ----------
        measure : callable
            Gives the state of the next step, with the reference that the drive runs at. Its
            argument is the reply to the step before, None in the first one.
        steps : int
            Control steps, 1 at least; the last one asks for zero.

        Raises
        ------
        ValueError
            If there is no step.
        TrippedError, LinkError, RefusedError
            As `step`; the gates are off.
        RuntimeError
            If no drive has been loaded.
        """
        if steps < 1:
            raise ValueError(f"ramp_down: got {steps} steps; 1 or more are needed")
        if self.drive is None:
            raise RuntimeError("ramp_down: no drive has been loaded; load(drive) comes first")
        reply = None
        try:
            for left in reversed(range(steps)):
                state = state_of(self.drive, measure(reply))
                reply = self.step(ramped(state, left / steps))
        finally:
            self.stop()

    def faults(self) -> tuple[str, ...]:
        """Names of the faults that the gate guard holds.

        Returns
        -------
        tuple of str
            As in docs/gate-guard.md; empty if there are none.

        Raises
        ------
        LinkError
            If the board does not answer.
        """
        return tuple(name for name, value in self.read("system.faults").items() if value)

    def differing(self, found: RegisterValues) -> list[str]:
        """Names of a drive's registers that read back another word than they should have.

        Parameters
        ----------
        found : RegisterValues
            What was loaded.

        Returns
        -------
        list of str
            In address order; empty where all is as it should be.

        Raises
        ------
        RegisterError
            If a register cannot be read.
        ValueError
            If a value does not fit its register.
        """
        # the commit, the last write, reads as nothing
        return [
            name for name, address, word in found.writes()[:-1] if self.read_word(address) != word
        ]

    def step(self, state: State | Mapping[str, Any], count: int | None = None) -> Reply:
        """What is measured in, what to apply next out.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            In the units of the drive file; or a row of its trace by column names.
        count : int or None
            Of the measurement, from what measures: raised by one with each. While the gates are on,
            the board refuses a measurement that is not newer than the last one. None: each call has
            a new one.

        Returns
        -------
        Reply
            The decision and what goes with it.

        Raises
        ------
        TrippedError
            If the drive was started and the gate guard holds a fault.
        DisabledError
            If it was started and is off: by the other link, or by a reset of the board.
        LinkError
            If no reply comes (a step is sent once), or the core gives no decision.
        RefusedError
            If the board refuses it: while the gates are on, the state has to name the positions
            that they are at, and its measurement has to be new.
        RuntimeError
            If no drive has been loaded.
        TypeError, StateError
            If the state is none of the drive's kind, has an impossible value, or lacks the dc-link
            voltage of a drive that was started.
        """
        if self.drive is None or self._encoder is None:
            raise RuntimeError("step: no drive has been loaded; load(drive) comes first")
        known = state_of(self.drive, state)
        self.refuse_unmeasured(known)
        words, clipped, position = self._encoder.words(known)
        answer = self.answer(words, position, count=count)
        return Reply(
            decision_of(self.drive.controller, answer, clipped, self.sequence()),
            answer.cycles,
            answer.gates,
            answer.has(Flag.ENABLED),
            answer.has(Flag.EXHAUSTED),
        )

    def refuse_unmeasured(self, state: State) -> None:
        """Refuse a state that lacks what the gate guard compares, while the drive is started.

        Parameters
        ----------
        state : MpdccState or MptcState
            As `step` takes it.

        Raises
        ------
        StateError
            If the drive was started and the state has no dc-link voltage.
        """
        if self._started and state.vdc is None:
            raise StateError(
                "vdc: missing; the measured dc-link voltage is needed while the drive is started, "
                "because the gate guard compares it (a row's column v_dc)"
            )

    def answer(
        self, words: list[int], position: int, name: str = "step", count: int | None = None
    ) -> Decision:
        """Measurement words in, a decision out, or the error that says why there is none.

        Parameters
        ----------
        words : list of int
            The core's measurement ports, in port order, in LSB of their formats.
        position : int
            MPDCC: s(k-1), packed; MPTC: u.
        name : str
            Of the step, for the message.
        count : int or None
            Of the measurement; None: a new one.

        Returns
        -------
        Decision
            With the clocks that it took.

        Raises
        ------
        TrippedError
            If the drive was started and the gate guard holds a fault.
        DisabledError
            If it was started and is off: by the other link, or by a reset of the board.
        LinkError
            If no reply comes (a step is sent once), or the core gives no decision.
        RefusedError
            If the board refuses it.
        """
        answer = self.exchange(words, position, count)
        if self._started and answer.has(Flag.TRIPPED):
            raise TrippedError(self.faults(), name)
        if self._started:
            self._watch(answer, name)
        if answer.has(Flag.NO_ANSWER):
            raise LinkError(f"{name}: the core gave no decision")
        return answer

    def _watch(self, answer: Decision, name: str) -> None:
        """Notice that a drive that was started is off although there is no fault."""
        if answer.has(Flag.ENABLED):
            self._waited = None
            return
        if self._waited is not None:  # the first decisions reach the gates later
            self._waited += 1
            if self._waited < _STEPS_TO_RUN:
                return
        if not self.read("system.status")["enabled"]:
            self._started = False
            raise DisabledError(
                f"{name}: the drive was started and is off: the other link has disabled it, or the "
                "board was reset; load it and start it anew"
            )

    def sequence(self) -> VectorSequence | None:
        """The sequence decided last.

        Returns
        -------
        VectorSequence or None
            None where the board was loaded with a method of one vector.

        Raises
        ------
        LinkError
            If the board does not answer.
        """
        if not self._kept["own_positions"]:
            return None
        vectors, times = self.read("result.vectors"), self.read("result.times")
        return VectorSequence(*vectors.values(), *(t / TIME_STEPS for t in times.values()))

    def exchange(self, words: list[int], position: int, count: int | None = None) -> Decision:
        """Measurement words in, the reply as it comes out.

        Parameters
        ----------
        words : list of int
            The core's measurement ports, in port order, in LSB of their formats.
        position : int
            MPDCC: s(k-1), packed; MPTC: u.
        count : int or None
            Of the measurement; None: one more than that of the step before.

        Returns
        -------
        Decision
            With the clocks that it took.

        Raises
        ------
        LinkError
            If no reply comes; a step is sent once.
        RefusedError
            If the board refuses it.
        """
        self._count = self._count + 1 if count is None else count
        payload = p.step_payload(words, position, self._count)
        return Decision.unpack(self.link.request(Type.STEP, payload, once=True))

    @cached_property
    def has_recorder(self) -> bool:
        """Whether the board was built with a recorder.

        Returns
        -------
        bool
            Asked for once.
        """
        return bool(self.read("system.capabilities")["recorder"])

    def recorder_status(self) -> RecorderStatus:
        """What the recorder in the fabric is at.

        Returns
        -------
        RecorderStatus
            Whether it records, what has triggered, and how much it holds.

        Raises
        ------
        RegisterError
            If the board was built without a recorder.
        """
        if not self.has_recorder:
            raise RegisterError("the board has no recorder; it was built with RECORDER_ROWS = 0")
        return RecorderStatus.of(self.read("recorder.status"))

    def arm_recorder(self, settings: Settings | None = None) -> None:
        """Let the recorder begin anew, with no record. A recording that it holds is lost.

        Parameters
        ----------
        settings : Settings, optional
            What triggers, and what is kept. A trip alone by default, every step, and nothing after.

        Raises
        ------
        RegisterError
            If the board was built without a recorder, or more is to be kept after the trigger than
            it has rows for.
        """
        chosen, status = settings or Settings(), self.recorder_status()
        if chosen.after > status.rows - 2:
            raise RegisterError(
                f"after: got {chosen.after} records; it must be at most {status.rows - 2}, or that "
                "of the trigger is written over"
            )
        for name, fields in chosen.registers().items():
            self.write(name, **fields)
        self.write("recorder.command", arm=1)

    def trigger_recorder(self) -> None:
        """Trigger the recorder now.

        Raises
        ------
        RegisterError
            If the board was built without a recorder.
        """
        self.write("recorder.command", trigger=1)

    def recording(
        self,
        last: int | None = None,
        drive: AnyDrive | None = None,
        meanwhile: Callable[[], None] = lambda: None,
    ) -> Recording:
        """What the recorder holds, while the drive runs or after it has stopped.

        Parameters
        ----------
        last : int, optional
            The newest so many records; all by default.
        drive : Drive, KbestDrive or MptcDrive, optional
            What the board has been loaded with, where that was not by this host.
        meanwhile : callable
            Is called before each request that reads a record.

        Returns
        -------
        Recording
            Columns by name, oldest step first; a trace and decisions. Records that were written
            over while they were read are left out.

        Raises
        ------
        RegisterError
            If the board was built without a recorder.
        RuntimeError
            If nothing says which drive the board has.
        """
        known = drive or self.drive
        if known is None:
            raise RuntimeError("recording: no drive has been loaded; drive= says which it was")
        self._check_controller(known.controller)
        decided = self.read("system.decisions")["count"]
        meanwhile()
        status = self.recorder_status()
        count = status.records if last is None else min(last, status.records)
        places = range(status.next_row - count, status.next_row)
        kept = {place: self._record(place % status.rows, meanwhile) for place in places}
        if (
            status.recording
        ):  # it has gone on meanwhile: a row for each decision at most, or a trigger
            status, before = self.recorder_status(), status
            decided = self.read("system.decisions")["count"] - decided & 0xFFFF_FFFF
            rate = self.read("recorder.compare")["decimation"] + 1
            written = before.next_row + -(-decided // rate) + 1 - before.rows
            kept = {place: record for place, record in kept.items() if place > written}
        rows = np.array(list(kept.values()), dtype=np.int64).reshape(len(kept), -1)
        if not kept:
            rows = np.zeros((0, STRIDE), dtype=np.int64)
        trigger = None
        if status.triggered and not status.recording and last is None:
            after = self.read("recorder.settings")["after"]
            trigger = len(kept) - 1 - after if len(kept) > after else None
        return Recording(known, unpack(self.controller, rows), trigger, status.cause)

    def _record(self, row: int, meanwhile: Callable[[], None]) -> list[int]:
        """Words of a row, those between the inputs and the decision zero."""
        meanwhile()
        self.write("recorder.row", row=row)
        address, _ = self._register("recorder.record")
        record = [0] * STRIDE
        inputs, results = record_words(self.controller)
        for place in (*range(inputs), *range(RESULTS_AT, RESULTS_AT + results)):
            meanwhile()
            record[place] = self.read_word(address + 4 * place)
        return record

    def counters(self) -> dict[Outcome, int]:
        """Frames by outcome since the board's reset, of this link.

        Returns
        -------
        dict of Outcome to int
            0 to 2**32 - 1.

        Raises
        ------
        LinkError
            If the board does not answer.
        """
        counts: list[int] = []
        for first in range(0, p.OUTCOME_COUNT, p.COUNTERS_PER_REPLY):
            reply = self.link.request(Type.COUNTERS, bytes([first]))
            counts += struct.unpack(f"<{p.COUNTERS_PER_REPLY}I", reply)
        return {outcome: counts[outcome] for outcome in Outcome}

    def has_capacitors(self) -> bool:
        """Whether the guard watches phase capacitors and a neutral point.

        Returns
        -------
        bool
            True for MPDCC and K-best.
        """
        return self.identity.controller is not Controller.MPTC

    def is_mpdcc(self) -> bool:
        """Which controller was built.

        Returns
        -------
        bool
            True for MPDCC, false for another one.
        """
        return self.identity.controller is Controller.MPDCC
