"""A board under the scope: its thread, what goes over its link, orders of pages and other hosts.

One thread owns the board. It steps the rig while the drive runs, and carries out orders between two
steps. Every STEP that goes over the link becomes a row of the record, whoever sent it.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

import numpy as np

from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.drive_tables import DriveError
from directmpc.host.board import Board, DisabledError, RegisterError, TrippedError
from directmpc.host.link import Link, LinkError, RefusedError
from directmpc.host.protocol import Decision, Flag, Type, step_size
from directmpc.host.registers import registers_of
from directmpc.host.rtl import Device
from directmpc.mpdcc.capacitor_observer import CapacitorFilter
from directmpc.scope.record import GateCourse, Record, of_recording, positions_of
from directmpc.scope.rigs import Setting, parameters_of, rig_of
from directmpc.scope.signals import fault_names

FAILURES = (
    LinkError,
    RefusedError,
    RegisterError,
    TrippedError,
    DisabledError,
    DriveError,
    ValueError,
)
_LOOKS = 50
_KEPT = 8
"""Recordings of the board that are kept."""
_POLL, _THEIRS = 0.5, 2.0
"""Between two looks at the board's recorder, s, and after another host has used it."""
FASTEST = 5_000
"""Most steps a second that can be asked for."""


class OrderError(Exception):
    """An order that cannot be carried out; `outcome` is the board's refusal, or -1.

    `last`: last sequence number that the board has acted upon. `told`: all of it, for another host.
    """

    def __init__(self, why: str, outcome: int = -1, last: int = 0) -> None:
        super().__init__(why)
        self.told = {"why": why, "outcome": outcome, "last": last}


class _InterruptedError(Exception):
    """The recorder is somebody else's now."""


class Tap(Link):
    """A link that tells what goes over it."""

    def __init__(self, link: Link, live: Live) -> None:
        self._link, self._live = link, live

    def request(self, kind: Type, payload: bytes = b"", *, once: bool = False) -> bytes:
        """Send a request, as `Link.request` does."""
        reply = self._link.request(kind, payload, once=once)
        if kind == Type.STEP:
            self._live.stepped(payload, Decision.unpack(reply))
        elif kind == Type.WRITE:
            self._live.written(payload)
        return reply


def compiled(drive: AnyDrive, record: Record) -> None:
    """Have everything compiled that a step needs."""
    rig_of(drive).state()
    record.signals.values({name: np.zeros(1) for name in record.signals.columns})


class Live(threading.Thread):
    """A board, the rig that it controls, and the record of both.

    `pace`: steps a second; infinite: as fast as the board is. `device`: pins of the board's RTL,
    its permit can be taken away.
    """

    def __init__(
        self,
        board: Board,
        drive: AnyDrive,
        record: Record,
        device: Device | None = None,
        pace: float = math.inf,
    ) -> None:
        super().__init__(daemon=True, name="scope")
        self._board, self._drive, self.record, self._device = board, drive, record, device
        board.link = Tap(board.link, self)
        self._rig = rig_of(drive)
        self.settings = [*self._rig.settings.values(), *parameters_of(drive)]
        if not board.real_time:
            most = FASTEST
            pace = min(pace, most)
            units = (("steps/s", 1.0), ("steps/s", 1.0))
            self.settings.append(Setting("pace", "pace", "reference", pace, 10, most, units))
        self._pace = next((s for s in self.settings if s.key == "pace"), None)
        self._orders: queue.SimpleQueue[tuple[Any, tuple[Any, ...], Future[Any]]] = (
            queue.SimpleQueue()
        )
        self._writes: deque[tuple[int, int]] = deque()
        self.recordings: dict[int, Record] = {}
        self.recorder = board.has_recorder
        self._recorded, self._touched, self._next_look = 0, 0, 0.0
        self._held: tuple[int, ...] = ()
        self._due = self._since = time.monotonic()
        self._counted = 0
        self._committed: tuple[AnyDrive, Mapping[str, float], Future[Any]] | None = None
        self._running = self._closing = False
        self._events: deque[dict[str, Any]] = deque(maxlen=20)
        self._error, self._rate, self._gates = "", 0.0, 0
        self._formats = list(kind_of(drive).formats(drive).items())
        self._course = GateCourse(drive)
        self._later: list[tuple[float, int]] = []
        self._forget()
        registers = registers_of(drive.controller)
        self._own = [at for name, (at, _) in registers.items() if name.startswith("recorder.")]
        self._loaded: dict[str, int] = {}
        compiled(drive, record)  # before a watchdog runs

    # ---- orders, from any thread ----

    def give(self, name: str, values: Any = None) -> Future[None]:
        """Order "start", "stop", "clear", "set", "trip" or "record".

        `values` are settings in the units of the drive file. The future has an `OrderError` where
        it cannot be.
        """
        known = {
            "start": self._start,
            "stop": self._stop,
            "clear": self._clear,
            "set": self._set,
            "trip": self._trip,
            "record": self._record,
        }
        done: Future[None] = Future()
        if name not in known:
            done.set_exception(OrderError(f"{name!r:.40}: the orders are {', '.join(known)}"))
        else:
            self._orders.put((known[name], (values,) if name == "set" else (), done))
        return done

    def joined(self, kind: int, once: bool, payload: bytes) -> Future[bytes]:
        """Order a request of another host; the future is the reply's payload or an `OrderError`."""
        done: Future[bytes] = Future()
        self._orders.put((self._request, (kind, once, payload), done))
        return done

    def state(self) -> dict[str, Any]:
        """What goes on, for the page."""
        return {
            "running": self._running,
            "gates": self._gates,
            "rate": round(self._rate, -1),
            "error": self._error,
            "events": list(self._events),
        }

    def close(self) -> None:
        """End the thread; the drive is off then, or its watchdog turns it off."""
        self._closing = True
        self.join(timeout=10)

    # ---- the thread ----

    def run(self) -> None:
        """Carry out orders and steps until it is closed."""
        while not self._closing:
            self._turn(0.05)
            self._look()
        self._off()

    def _turn(self, wait: float) -> None:
        """Carry out orders, then a step if the drive runs."""
        self._carry_out(0.0 if self._running else wait)
        if not self._running:
            self._due = self._since = time.monotonic()
            self._counted, self._rate = 0, 0.0
            return
        if self._pace is not None and self._pace.value < FASTEST:
            self._due = max(self._due + 1 / self._pace.value, time.monotonic() - 0.1)
            if (wait := self._due - time.monotonic()) > 0:
                time.sleep(wait)
        self._step()
        self._counted += 1
        if (now := time.monotonic()) - self._since > 0.5:
            self._rate = self._counted / (now - self._since)
            self._counted, self._since = 0, now

    def _carry_out(self, wait: float) -> None:
        """Do what has been ordered."""
        try:
            while True:
                work, arguments, done = (
                    self._orders.get(timeout=wait) if wait else self._orders.get_nowait()
                )
                wait = 0.0
                try:
                    later = work(*arguments)
                except FAILURES as error:
                    done.set_exception(OrderError(str(error)))
                except OrderError as error:
                    done.set_exception(error)
                else:
                    if isinstance(later, tuple):
                        self._committed = (*later, done)
                    else:
                        done.set_result(later)
        except queue.Empty:
            return

    def _step(self) -> None:
        try:
            self._rig.apply(self._board.step(self._rig.state()).decision)
            if self._writes:  # one a step, or a watchdog of the control period would run out
                self._write_next()
        except TrippedError as error:
            self._event("trip", list(error.faults))
            self._failed("")
        except FAILURES as error:
            self._failed(str(error))

    def _failed(self, why: str) -> None:
        self._error = why
        if why:
            self._event("error", [why])
        self._off()

    def _off(self) -> None:
        """Gates off; where the board does not hear it, its watchdog does it."""
        self._running = False
        self._writes.clear()
        if self._committed is not None:
            self._committed[2].set_exception(OrderError("the drive went off before the commit"))
            self._committed = None
        try:
            self._board.stop()
            for _ in range(_LOOKS):  # a leg may go off in steps
                if not (found := self._board.read("system.gates")["gates"]):
                    break
            self._gates = found
        except (LinkError, RefusedError) as error:
            self._error = str(error)
        self._note_edges(False)
        self._next_look = 0.0

    def _event(self, kind: str, names: list[str]) -> None:
        self._events.append({"kind": kind, "names": names, "row": max(0, self.record.total - 1)})

    # ---- the recorder of the board ----

    def _look(self) -> None:
        """Look for a recording from time to time; a step lies between two requests."""
        if not self.recorder or time.monotonic() < self._next_look:
            return
        self._next_look = time.monotonic() + _POLL
        began = self._touched

        def meanwhile() -> None:
            self._turn(0.0)
            if self._touched != began or self._closing:
                raise _InterruptedError

        try:
            self._read(meanwhile)
        except _InterruptedError:
            pass
        except FAILURES as error:
            self._error = str(error)

    def _read(self, meanwhile: Callable[[], None]) -> bool:
        """Offer a recording that has ended and is new; whether there is one, new or not."""
        status = self._board.recorder_status()
        if not status.triggered or status.recording:
            return False
        newest = self._board.recording(1, self._drive, meanwhile).fields.values()
        held = (status.next_row, *(int(column[-1]) for column in newest if len(column)))
        if held == self._held:
            return True
        found = self._board.recording(None, self._drive, meanwhile)
        latched = [name for name, value in self._board.read("system.faults").items() if value]
        cause = [n for c in found.cause for n in (latched if c == "fault" and latched else [c])]
        record = of_recording(self._drive, found.columns, found.trigger, cause)
        self._held, self._recorded = held, self._recorded + 1
        self.recordings[self._recorded] = record
        self.recordings.pop(self._recorded - _KEPT, None)
        row = len(found) - 1 if found.trigger is None else found.trigger
        self._events.append(
            {
                "kind": "recorder",
                "names": cause,
                "row": row,
                "rows": len(found),
                "recording": self._recorded,
            }
        )
        if found.cause == ("manual",):
            self._arm()
        return True

    def _arm(self) -> None:
        self._held = ()
        self._board.write("recorder.command", arm=1)

    def _record(self) -> None:
        """Trigger the recorder: what it holds is read then, and it goes on."""
        if not self.recorder:
            raise OrderError("the board has no recorder")
        status = self._board.recorder_status()
        if status.triggered and not status.recording:
            raise OrderError("the recorder has stopped; Events lists what it holds")
        self._board.trigger_recorder()
        self._next_look = 0.0

    def _start(self) -> None:
        if self._running:
            raise OrderError("the drive runs already")
        self._error = ""
        self._load()
        self._rig.reset()
        cleared = self._board.read("system.faults")
        if latched := [name for name, value in cleared.items() if value]:
            raise OrderError(f"faults are latched: {', '.join(latched)}; clear them first")
        if self.recorder:
            self._touched += 1
            if self._read(lambda: None):
                self._arm()
        self._board.start()
        self._running = True

    def _load(self) -> None:
        self._board.load(self._drive)
        self._loaded = dict(self._board.values(self._drive).words)

    def _stop(self) -> None:
        if self._running:
            self._event("stop", [])
        self._off()

    def _clear(self) -> None:
        if self._running:
            raise OrderError("the drive runs; there is no fault")
        if self._device is not None:
            self._device.design.put("permit", 1)
        self._error = ""
        self._board.write("system.faults", **self._board.read("system.faults"))

    def _trip(self) -> None:
        if self._device is None:
            raise OrderError("only the virtual board's permit can be taken away here")
        self._device.design.put("permit", 0)

    def _set(self, values: Any) -> tuple[AnyDrive, Mapping[str, float]] | None:
        """References at once; parameters together, by one commit."""
        known = {setting.key: setting for setting in self.settings}
        if not isinstance(values, dict) or not values:
            raise OrderError("set needs keys and values")
        for key, value in values.items():
            if key not in known:
                raise OrderError(f"{key!r:.40}: there is no such setting")
            low, high = known[key].low, known[key].high
            if not isinstance(value, int | float) or not low - 1e-9 <= value <= high + 1e-9:
                raise OrderError(f"{key}: got {value!r:.40}; it must be from {low:g} to {high:g}")
        chosen = {k: (round(v) if known[k].whole else float(v)) for k, v in values.items()}
        parameters = {k: v for k, v in chosen.items() if known[k].kind == "parameter"}
        if not parameters:
            self._take(chosen)
            return None
        if self._committed is not None:
            raise OrderError("a commit is under way; try again")
        drive = self._drive.with_control(**parameters)
        words = self._board.values(drive).words
        if not self._running:
            self._drive = drive
            self._take(chosen)
            return None
        registers = registers_of(drive.controller)
        for name, word in words.items():
            if word != self._loaded.get(name):
                address, fields = registers[name]
                if name.startswith(("guard.", "bands.")):
                    raise OrderError(f"{name} is locked while the drive runs; stop it first")
                _, width, _ = next(iter(fields.values()))
                self._writes.append((address, word & (1 << max(width, 1)) - 1))
        address, _ = registers["system.command"]
        self._writes.append((address, 1))
        self._loaded = dict(words)
        return drive, chosen

    def _write_next(self) -> None:
        self._board.write_word(*self._writes.popleft())
        if not self._writes and self._committed is not None:
            drive, chosen, done = self._committed
            self._committed, self._drive = None, drive
            self._board.drive = drive
            self._take(chosen)
            done.set_result(None)

    def _take(self, chosen: Mapping[str, float]) -> None:
        for setting in self.settings:
            setting.value = chosen.get(setting.key, setting.value)

    def _request(self, kind: int, once: bool, payload: bytes) -> bytes:
        """A request of another host, between two steps."""
        if kind not in (Type.IDENTIFY, Type.READ, Type.WRITE, Type.STEP, Type.COUNTERS):
            raise OrderError("no request of a link")
        control = registers_of(self._drive.controller)["system.control"][0]
        disables = kind == Type.WRITE and payload == control.to_bytes(2, "little") + bytes(4)
        records = kind == Type.WRITE and int.from_bytes(payload[:2], "little") in self._own
        if records:  # it reads the recorder
            self._touched += 1
            self._next_look = time.monotonic() + _THEIRS
        elif self._running and kind in (Type.WRITE, Type.STEP):
            if not disables:
                raise OrderError("the scope runs the drive; stop it there first")
            self._stop()
        if kind == Type.STEP and len(payload) != step_size(self._board.identity.controller):
            raise OrderError("a step of another size")
        try:
            return self._board.link.request(Type(kind), payload, once=once)
        except RefusedError as refused:
            raise OrderError(str(refused), int(refused.outcome), refused.last_sequence) from None

    # ---- what goes over the link ----

    def _forget(self) -> None:
        filtered = getattr(self._drive.control, "capacitor_filter", 0)
        self._filters = CapacitorFilter(self._drive) if filtered else None

    def written(self, payload: bytes) -> None:
        """A register has been written."""
        address, fields = registers_of(self._drive.controller)["system.command"]
        place = fields["reset_observer"][0]
        written = int.from_bytes(payload[:2], "little"), int.from_bytes(payload[2:], "little")
        if written[0] == address and written[1] >> place & 1:
            self._forget()

    def stepped(self, payload: bytes, answer: Decision) -> None:
        """A step has been answered: a row of the record."""
        words = np.frombuffer(payload, "<u2").astype(np.int64)
        row: dict[str, float] = {}
        for word, (name, format_) in zip(words.tolist(), self._formats, strict=False):
            if format_.signed and word >> 15:
                word -= 1 << 16
            row[name] = word / format_.scale
        last, control = int(words[-1]), self._drive.control
        if self.record.signals.five:
            before = tuple(last >> 3 * n & 7 for n in range(3))
            row |= dict(zip(("s_a", "s_b", "s_c"), before, strict=True))
            row |= {f"next_s_{x}": s for x, s in zip("abc", answer.positions, strict=True)}
            for flag in (Flag.HELD, Flag.DEADLOCK, Flag.SATURATED, Flag.EXHAUSTED):
                row[f"next_{flag.name.lower()}"] = answer.has(flag)
            row["next_length"] = answer.length
            for name in ("bound_current", "bound_vn", "bound_vph"):
                row[name] = getattr(control, name, math.nan)
            if self._filters is not None:
                signed = [
                    w - (f.signed and w >> 15) * 65536
                    for w, (_, f) in zip(words.tolist(), self._formats, strict=False)
                ]
                row["v_n"], row["v_ph_a"], row["v_ph_b"], row["v_ph_c"] = self._filters.voltages(
                    signed, before
                )
        else:
            row |= {"u": last & 7, "next_u": answer.position & 7}
            row |= {
                "next_saturated": answer.has(Flag.SATURATED),
                "next_clamped": answer.has(Flag.CLAMPED),
            }
        running = answer.has(Flag.ENABLED)
        row |= {
            "cycles": answer.cycles,
            "faults": answer.faults,
            "gates": answer.gates,
            "running": running,
        }
        row |= {"leakage": math.nan, "cost": math.nan}  # no reply has them
        columns = self.record.signals.columns
        self.record.append(np.array([[row[name] for name in columns]], np.float64))
        self._gates = answer.gates
        if answer.faults and not self._running:
            self._event("fault", fault_names(answer.faults))
        self._note_edges(running, row)

    def _note_edges(self, running: bool, row: Mapping[str, float] | None = None) -> None:
        """Changes of the gates that follow from the last row, or from a stop behind it."""
        positions = positions_of(self.record.signals, row) if row else [0, 0, 0]
        number = self.record.total - (row is not None)
        came = self._course.step(number, positions, running)
        if row is None:  # what waited for the next step reaches no gate
            self._later = []
        elif self._course.delay:
            came, self._later = self._later, came
        self.record.add_edges(came)
