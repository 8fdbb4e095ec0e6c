"""The scope without a browser: channels, exports, the native board, who may come in.

Stimulus: simulations of both kinds of drive; a native board in closed loop, tripped; requests and
websockets of this computer, of other origins and hosts, with and without a token.
Checks: channels against the result; a trace and its decisions read back bit by bit and decided
again alike; the drawn gates against every change of a native board's gates; parameters in one
commit; gates off after a page has gone, a trip, a line that is cut; another host over the scope.
Does not prove: what the page shows (tb/commands/test_scope_page.py does).
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from directmpc import Drive, decide, load_drive, simulate
from directmpc.csv_table import TraceError
from directmpc.host import __main__ as host
from directmpc.host.board import Board, RegisterError
from directmpc.host.link import Link, LinkError
from directmpc.host.protocol import Type
from directmpc.host.registers import registers_of
from directmpc.host.rtl import BOARDS, Device
from directmpc.host.spi import SpiStream
from directmpc.scope import record as records
from directmpc.scope import server as served
from directmpc.scope.live import Live, OrderError
from directmpc.scope.record import Record
from scripts.hdl import native
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared.tools import ROOT

DRIVES = {"anpc5l_6kv": "mpdcc_board", "induction_2kw2": "mptc_board"}
KBEST = "anpc5l_6kv_kbest"


@pytest.mark.parametrize("name", [*DRIVES, "npc3l_3kv3"])
def test_channels_are_the_results(name: str) -> None:
    result = simulate(load_drive(name), "ideal", steps=200)
    record = records.of_result(result)
    keys = [channel.key for channel in record.signals.channels]
    values = dict(zip(keys, record.signals.values(record.table(0, 200)), strict=True))
    for n, phase in enumerate("abc"):
        assert np.allclose(values[f"i_{phase}"], result.phase_currents[:, n], atol=1e-5)
    assert np.allclose(values["omega_r"], result.omega_r, rtol=1e-6)
    # the result's torque is taken between the steps of a two-level drive, and is the plant's
    assert np.corrcoef(values["torque"], result.torque)[0, 1] > 0.9 or np.ptp(result.torque) == 0
    if isinstance(result.drive, Drive):
        inside = (values["i_a"] > values["i_a_low"] - 0.1) & (
            values["i_a"] < values["i_a_high"] + 0.1
        )
        assert inside.all()
        assert np.nanmin(values["second"] - values["cost"]) >= 0.0
    assert {c.low for c in record.signals.channels} - {""} <= set(keys)


@pytest.mark.parametrize("name", DRIVES)
def test_a_trace_comes_back_bit_by_bit(name: str, tmp_path: Path) -> None:
    result = simulate(load_drive(name), "model", steps=60)
    record = records.of_result(result)
    for kind in ("trace", "decisions"):
        file, data = records.written(record, kind, 0, 60, 0)
        (tmp_path / file).write_bytes(data)
    result.write_trace(tmp_path / "own.csv")
    assert (tmp_path / "scope-trace.csv").read_bytes() == (tmp_path / "own.csv").read_bytes()
    again = records.of_files(
        result.drive, tmp_path / "scope-trace.csv", tmp_path / "scope-decisions.csv"
    )
    first, second = record.table(0, 60), again.table(0, 60)
    assert all(np.array_equal(first[name], second[name], equal_nan=True) for name in first)
    assert record.edges_from(0) == again.edges_from(0)
    short = (tmp_path / "scope-decisions.csv").read_text().splitlines()[:-1]
    (tmp_path / "short.csv").write_text("\n".join(short) + "\n")
    with pytest.raises(TraceError, match="59 rows; the trace has 60"):
        records.of_files(result.drive, tmp_path / "scope-trace.csv", tmp_path / "short.csv")


def test_exports_name_units_and_hold_the_gates(tmp_path: Path) -> None:
    pylibfst = pytest.importorskip("pylibfst")
    drive = load_drive("anpc5l_6kv")
    record = records.of_result(simulate(drive, "ideal", steps=100))
    _, data = records.written(record, "csv", 10, 20, 0)
    lines = data.decode().splitlines()
    assert lines[0].startswith("time [s],i_a [A],")
    assert len(lines) == 11
    value = record.signals.values(record.table(10, 11))[0, 0] * drive.base.current
    assert float(lines[1].split(",")[1]) == pytest.approx(value, rel=1e-5)
    name, data = records.written(record, "fst", 0, 100, 0)
    (tmp_path / name).write_bytes(data)
    context = pylibfst.lib.fstReaderOpen(str(tmp_path / name).encode())
    assert context != pylibfst.ffi.NULL
    assert pylibfst.lib.fstReaderGetVarCount(context) == len(record.signals.channels) + 24
    changes: list[tuple[int, bytes]] = []
    pylibfst.lib.fstReaderSetFacProcessMaskAll(context)
    pylibfst.fstReaderIterBlocks(
        context, lambda _, when, handle, value: changes.append((when, handle))
    )
    pylibfst.lib.fstReaderClose(context)
    first_gate = len(record.signals.channels) + 1
    times = {when for when, handle in changes if handle >= first_gate}
    assert {round(time * 1e9) for time, _ in record.edges_from(0)} <= times | {0}
    with pytest.raises(ValueError, match="no such rows"):
        records.written(record, "csv", 100, 200, 0)


def test_a_simulation_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    made: list[Any] = []
    serving = served.serving
    monkeypatch.setattr(served, "serving", lambda *a: made.append(serving(*a)) or made[-1])
    result = simulate(load_drive("anpc5l_6kv"), "ideal", steps=20, scope=True)
    try:
        with urllib.request.urlopen(opened[0], timeout=20) as answer:
            assert b"scope.js" in answer.read()
        with urllib.request.urlopen(f"{opened[0]}export/trace", timeout=20) as answer:
            assert len(answer.read().splitlines()) == len(result) + 1
    finally:
        made[0][0].should_exit = True


def test_a_record_forgets_its_oldest_rows() -> None:
    record = Record(load_drive("anpc5l_6kv"), 10)
    width = len(record.signals.columns)
    record.append(np.arange(25.0)[:, None] * np.ones(width))
    assert (record.first, record.total) == (15, 25)
    assert record.table(0, 100)["v_n"].tolist() == list(range(15, 25))
    assert record.table(20, 22)["v_n"].tolist() == [20, 21]


# ---- a board ----


@pytest.fixture(scope="module", params=DRIVES)
def name(request: pytest.FixtureRequest) -> str:
    """A drive whose system is there."""
    native.write([BOARDS[load_drive(request.param).controller]])
    return str(request.param)


class Running:
    """A live scope around a native board."""

    def __init__(self, name: str) -> None:
        self.drive = load_drive(name)
        self.device = Device(self.drive.controller)
        self.stream = SpiStream(self.device)
        self.board = Board(Link(self.stream))
        self.record = Record(self.drive)
        self.live = Live(self.board, self.drive, self.record, self.device)
        self.live.start()

    def order(self, name: str, values: object = None) -> None:
        """Give an order and wait for it."""
        self.live.give(name, values).result(timeout=180)

    def wait(self, rows: int) -> None:
        """Wait until there are so many rows more."""
        goal, end = self.record.total + rows, time.monotonic() + 180
        while self.record.total < goal:
            assert time.monotonic() < end, self.live.state()
            time.sleep(0.01)

    def recorded(self) -> dict[str, Any]:
        """The event of a recording, once the board's recorder has been read."""
        end = time.monotonic() + 180
        while not (event := (self.live.state()["events"] or [{}])[-1]).get("recording"):
            assert time.monotonic() < end, self.live.state()
            time.sleep(0.01)
        return event

    def read(self, name: str) -> int:
        """A register's word, read between two steps."""
        address, _ = registers_of(self.drive.controller)[name]
        payload = self.live.joined(Type.READ, False, address.to_bytes(2, "little"))
        return int.from_bytes(payload.result(timeout=180)[3:], "little")

    @property
    def gates(self) -> int:
        """The gates of the board."""
        return self.device.design.get("gates")


@pytest.fixture
def running(name: str) -> Iterator[Running]:
    """A live scope, closed at the end; the gates are off then."""
    one = Running(name)
    yield one
    one.live.close()
    assert one.gates == 0


@pytest.mark.parametrize("name", [*DRIVES, KBEST], indirect=True)
def test_a_board_runs(running: Running) -> None:
    running.order("start")
    running.wait(300)
    running.order("stop")
    assert running.gates == 0
    table = running.record.table(0, running.record.total)
    assert table["running"][10:].all()
    assert table["faults"].max() == 0
    assert table["omega_r"][-1] > table["omega_r"][0]
    assert table["cycles"].min() > 0


@pytest.mark.parametrize("name", DRIVES)
def test_gates_are_drawn_as_a_board_switches_them(name: str, tmp_path: Path) -> None:
    drive, log = load_drive(name), tmp_path / "gates.csv"
    record = Record(drive)
    # the netlist of rtl:, which keeps no log of its gates
    _, chosen = native.DESIGNS[DRIVES[name]]
    port = tmp_path / "port"
    with VirtualBoard(chosen, port, log), Board(port, timeout=20) as board:
        live = Live(board, drive, record)
        live.start()
        live.give("start").result(timeout=180)
        end = time.monotonic() + 300
        while record.total < 700 and time.monotonic() < end:
            time.sleep(0.01)
        live.give("stop").result(timeout=180)
        live.close()
    lines = [line.split(",") for line in log.read_text().split()[1:]]
    seen = [(int(clock), int(gates, 16)) for clock, gates in lines]
    drawn = record.edges_from(0)
    # start and stop are sequenced otherwise
    words = [word for _, word in drawn][1:-1]
    order = [word for _, word in seen]
    begin = next(n for n in range(len(order)) if order[n : n + 20] == words[:20])
    assert len(words) > 50
    found = seen[begin : begin + len(words)]
    assert [word for _, word in found] == words
    # within a move a dead time lies between two gates, as drawn
    spaces = np.diff([time for time, _ in drawn][1:-1]) * chosen["CLOCK_HZ"]
    clocks = np.diff([clock for clock, _ in found])
    moves = spaces < 200
    assert moves.any()
    assert np.allclose(spaces[moves], clocks[moves], atol=1)


def test_what_was_recorded_is_decided_again_alike(running: Running) -> None:
    running.order("start")
    running.wait(200)
    running.order("stop")
    table = running.record.table(0, running.record.total)
    for k in range(5, 200, 7):
        row = {column: values[k] for column, values in table.items()}
        if isinstance(running.drive, Drive):
            found = decide(running.drive, row, "model")
            assert found.apply == tuple(int(row[f"next_s_{x}"]) for x in "abc")
            assert found.length == row["next_length"]
        else:
            assert decide(running.drive, row, "model").apply == row["next_u"]


def test_parameters_change_in_one_commit_while_it_runs(running: Running) -> None:
    running.order("start")
    running.wait(50)
    before = running.read("system.commits")
    mpdcc = isinstance(running.drive, Drive)
    values = {"bound_current": 0.2, "lambda_n": 0.5} if mpdcc else {"k_psi": 20.0}
    running.order("set", values | {"speed": 0.5})
    running.wait(100)
    running.order("stop")
    assert running.read("system.commits") == before + 1
    drive = running.drive.with_control(**values)
    assert not running.board.differing(running.board.values(drive))
    assert {s.key: s.value for s in running.live.settings}["speed"] == 0.5
    if mpdcc:
        bounds = running.record.table(0, running.record.total)["bound_current"]
        assert sorted(set(bounds)) == [0.1, 0.2]
    with pytest.raises(OrderError, match="there is no such setting"):
        running.order("set", {"bound": 1})
    with pytest.raises(OrderError, match="it must be from"):
        running.order("set", {next(iter(values)): 1e9})


def test_a_trip_is_recorded_with_what_came_before(running: Running) -> None:
    running.order("start")
    running.wait(60)
    running.order("trip")
    end = time.monotonic() + 60
    while running.live.state()["running"]:
        assert time.monotonic() < end
        time.sleep(0.01)
    event = running.live.state()["events"][-1]
    assert (event["kind"], event["names"]) == ("trip", ["external_trip"])
    table = running.record.table(event["row"] - 20, event["row"] + 1)
    assert table["faults"][-1] == 1
    assert table["running"][:20].all()
    assert running.gates == 0
    with pytest.raises(OrderError, match="clear them first"):
        running.order("start")
    running.order("clear")
    running.order("start")
    running.wait(20)


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"], indirect=True)
def test_the_board_s_recorder_is_read_after_a_trip(running: Running, tmp_path: Path) -> None:
    running.order("start")
    running.wait(300)
    running.order("trip")
    event = running.recorded()
    assert (event["names"], event["rows"]) == (["external_trip"], native.RECORDER - 1)
    shown = running.live.recordings[event["recording"]]
    table = shown.table(0, event["row"] + 1)
    # the trip came before the host's last step had begun; the same steps as the host has seen them,
    # but for gates, which it gets a clock later, and the cost, which only the recorder has
    last = running.record.total - 1
    seen = running.record.table(last - event["row"] - 1, last)
    assert running.record.table(last, last + 1)["faults"] == 1
    for column in set(table) - {"gates", "cost"}:
        assert np.array_equal(table[column], seen[column]), column
    place = [c.key for c in shown.signals.channels].index("cost")
    core, ideal = (shown.signals.values(t)[place] for t in (table, seen))
    known = np.isfinite(core) & np.isfinite(ideal)
    assert known.sum() > 3
    assert np.median(np.abs(core - ideal)[known]) < 0.02 * np.nanmax(ideal)
    one = Served(running.record, running.live, None, tmp_path)
    address = f"http://127.0.0.1:{one.port}/"
    try:
        hello = asyncio.run(one.websocket(f"?recording={event['recording']}"))["hello"]
        assert (hello["live"], hello["ts"]) == (False, shown.ts)
        with urllib.request.urlopen(f"{address}export/trace?recording=1", timeout=60) as answer:
            exported = answer.read()
        assert one.get("/export/trace?recording=9") == 400
        # another host reads the same through the scope, into files
        files = [str(tmp_path / f"{name}.csv") for name in ("trace", "table")]
        ends = ["--trace", files[0], "--table", files[1]]
        drive = next(p for p in (ROOT / "drives").glob("*.toml") if load_drive(p) == running.drive)
        port = ["--port", f"scope:{address}", "--timeout", "20"]
        assert host.main([*port, "record", str(drive), *ends]) == 0
        theirs = Path(files[0]).read_bytes()
        if not shown.signals.five:  # whose export leaves the usual link out
            link = f"{running.drive.inverter.vdc!r}".encode()
            theirs = re.sub(rb",(?:v_dc|" + re.escape(link) + rb")$", b"", theirs, flags=re.M)
        assert theirs == exported
    finally:
        one.close()
    again = records.of_table(running.drive, Path(files[1]))
    whole = shown.table(0, shown.total)
    kept = again.table(0, again.total)
    assert all(np.array_equal(whole[name], c, equal_nan=True) for name, c in kept.items())
    assert (again.edges_from(0), again.ts) == (shown.edges_from(0), shown.ts)
    assert [e["row"] for e in again.events] == [event["row"]]


def test_a_line_that_is_cut_ends_the_run(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    running.order("start")
    running.wait(20)
    with monkeypatch.context() as patched:

        def gone(data: bytes) -> None:
            raise LinkError("the line is cut")

        patched.setattr(running.stream, "write", gone)
        end = time.monotonic() + 60
        while running.live.state()["running"]:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert "cut" in running.live.state()["error"]
        assert running.gates != 0, "nobody could tell the board"
        running.device.design.clocks(70_000)
    assert running.gates == 0, "its watchdog did it"


# ---- who may come in, and other hosts ----


class Served:
    """A server of the scope in a thread."""

    def __init__(self, record: Record, live: Live | None, token: str | None, folder: Path) -> None:
        presets = served.Presets(folder / "presets.json")
        self.server = served.Server(record, live, "test", token, presets)
        self._http, self._listening = served.serving(self.server, "127.0.0.1", 0)
        self.port = self._listening.getsockname()[1]
        self._thread = threading.Thread(
            target=self._http.run, kwargs={"sockets": [self._listening]}
        )
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._http.should_exit = True
        self._thread.join(timeout=60)

    def get(self, path: str = "/", data: bytes | None = None, **headers: str) -> int:
        """Status of a request."""
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        asked = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", data, names)
        try:
            with urllib.request.urlopen(asked, timeout=60) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as error:
            return error.code

    async def websocket(self, query: str = "", origin: str | None = None) -> dict[str, object]:
        """What a page is told first."""
        async with connect(f"ws://127.0.0.1:{self.port}/ws{query}", origin=origin) as page:
            return dict(json.loads(await page.recv()))


@pytest.fixture
def recorded(tmp_path: Path) -> Iterator[Served]:
    """A server of an empty record."""
    one = Served(Record(load_drive("anpc5l_6kv"), 10), None, None, tmp_path)
    yield one
    one.close()


def test_only_the_own_page_comes_in(recorded: Served) -> None:
    own = f"http://127.0.0.1:{recorded.port}"
    assert recorded.get() == 200
    assert recorded.get(Origin=own) == 200
    assert recorded.get("/static/scope.js") == 200
    assert recorded.get(Host="evil.example") == 403  # a name that was bent to this address
    assert recorded.get(Host="127.0.0.1.evil.example") == 403
    for path, data in (("/", None), ("/link", b"\0\0"), ("/export/csv", None)):
        assert recorded.get(path, data, Origin="http://evil.example") == 403
        assert recorded.get(path, data, Origin="null") == 403
        assert recorded.get(path, data, Sec_Fetch_Site="cross-site") == 403
    assert recorded.get("/link", b"\0\0") == 409
    assert recorded.get("/static/../server.py") == 404
    assert "hello" in asyncio.run(recorded.websocket(origin=own))
    for origin in ("http://evil.example", f"http://127.0.0.1:{recorded.port + 1}", "null"):
        with pytest.raises(InvalidStatus):
            asyncio.run(recorded.websocket(origin=origin))


def test_elsewhere_a_token_is_needed(tmp_path: Path) -> None:
    one = Served(Record(load_drive("anpc5l_6kv"), 10), None, "secret", tmp_path)
    try:
        for path in ("/", "/static/scope.js", "/export/csv", "/?token=", "/?token=secres"):
            assert one.get(path) == 403
        assert one.get("/?token=secret") == 200
        assert one.get("/static/scope.js", Cookie="directmpc_scope=secret") == 200
        assert one.get("/", Cookie="directmpc_scope=other") == 403
        assert one.get("/?token=secret", Origin="http://evil.example") == 403
        assert "hello" in asyncio.run(one.websocket("?token=secret"))
        with pytest.raises(InvalidStatus):
            asyncio.run(one.websocket())
    finally:
        one.close()


def test_presets_stay(tmp_path: Path) -> None:
    presets = served.Presets(tmp_path / "new" / "presets.json")
    assert presets.all() == {}
    presets.keep("a", {"span": 10})
    presets.keep("b", {"span": 20})
    assert served.Presets(presets.path).keep("a", None) == {"b": {"span": 20}}
    presets.path.write_text("no JSON")
    assert presets.all() == {}


async def _page_that_leaves(port: int, rows: Record) -> None:
    async with connect(f"ws://127.0.0.1:{port}/ws") as page:
        await page.send(json.dumps({"do": "start", "number": 1}))
        while rows.total < 30:
            await asyncio.wait_for(page.recv(), 60)


def test_a_page_that_closes_turns_the_gates_off(running: Running, tmp_path: Path) -> None:
    one = Served(running.record, running.live, None, tmp_path)
    try:
        asyncio.run(_page_that_leaves(one.port, running.record))
        end = time.monotonic() + 60
        while running.live.state()["running"] or running.gates:
            assert time.monotonic() < end
            time.sleep(0.01)
    finally:
        one.close()


def test_another_host_joins(running: Running, tmp_path: Path) -> None:
    one = Served(running.record, running.live, None, tmp_path)
    joined = Board(f"scope:http://127.0.0.1:{one.port}/", timeout=60)
    try:
        running.order("start")
        running.wait(20)
        assert joined.read("system.status")["running"] == 1
        with pytest.raises(LinkError, match="the scope runs the drive"):
            joined.write("guard.watchdog", clocks=1)
        joined.stop()
        assert not running.live.state()["running"]
        # its own steps are shown too
        row = {name: column[-1] for name, column in running.record.table(0, 10**9).items()}
        joined.load(running.drive)
        before = running.record.total
        reply = joined.step(row)
        assert running.record.total == before + 1
        assert running.record.table(before, before + 1)["cycles"][0] == reply.cycles
        with pytest.raises(RegisterError, match="there is no such register"):
            joined.read_word(0x37C)
    finally:
        one.close()
    with pytest.raises(LinkError):
        joined.read("system.status")
    with pytest.raises(LinkError, match="the address that a scope prints"):
        Board("scope:nowhere")


def test_a_scope_that_is_killed_leaves_the_watchdog(tmp_path: Path) -> None:
    drive, port = load_drive("anpc5l_6kv"), tmp_path / "port"
    command = [sys.executable, "-m", "directmpc", "scope", str(port), "--no-browser", "--http", "0"]
    with VirtualBoard(generics("mpdcc"), port) as virtual:
        environment = os.environ | {"PYTHONPATH": str(ROOT / "model")}
        scope = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
        try:
            assert scope.stdout is not None
            said = scope.stdout.readline()
            page_port = int(said.rsplit(":", 1)[1].rstrip("/\n"))
            # the port is the scope's alone
            with pytest.raises(LinkError, match="another program uses it"):
                Board(port)

            async def start() -> None:
                async with connect(f"ws://127.0.0.1:{page_port}/ws") as page:
                    await page.send(json.dumps({"do": "start", "number": 1}))
                    while True:
                        told = await asyncio.wait_for(page.recv(), 120)
                        if isinstance(told, str) and json.loads(told).get("state", {}).get("gates"):
                            break
                    scope.kill()
                    scope.wait(timeout=20)

            asyncio.run(start())
        finally:
            scope.kill()
            scope.wait(timeout=20)
        with Board(virtual.port, timeout=20) as board:
            assert board.read("system.gates")["gates"], "the board's time stands without traffic"
            for _ in range(300):
                if not board.read("system.gates")["gates"]:
                    break
            assert not board.read("system.gates")["gates"]
            assert board.faults() == ("missing",)
            assert board.controller == drive.controller
