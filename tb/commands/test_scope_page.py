"""The scope's page in a real browser: each view, each button, the keyboard, a narrow screen.

Stimulus: a recorded simulation with known figures; a drive on the board's RTL, started, set,
tripped and stopped by clicks and keys; pages that are closed.
Checks: what the page draws and says against the library; what it exports against the run; frames a
second with 20 channels of 1,000 points; twenty steps before a trip in two clicks; memory.
Timing: half a minute, and the build of the board's RTL the first time.
Does not prove: that a slower computer draws as fast. Without a Chromium, as in CI, all of it is
skipped, and the report says so.

The pictures of docs/scope.md are made here: SCOPE_PICTURES=docs .venv/bin/python -m pytest
tb/commands/test_scope_page.py -k pictures
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from directmpc import load_drive, simulate
from directmpc.distortion import thd
from directmpc.host.gate_guard import FAULTS
from directmpc.mpdcc.trace import write_decisions
from directmpc.mptc.trace import write_decisions as write_two_level
from directmpc.scope import record as records
from directmpc.scope import server
from directmpc.scope.signals import Signals
from scripts.hdl import native
from scripts.shared.tools import ROOT

BROWSER = next(
    (p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None
)

STEPS = 1200
#: How many colours each canvas has.
COLOURS = """directmpc.views.map((view) => {
  const canvas = view.plot.ctx.canvas, seen = new Set();
  const data = view.plot.ctx.getImageData(0, 0, canvas.width, canvas.height).data;
  for (let k = 0; k < data.length; k += 4)
    if (data[k + 3] > 128) seen.add(data[k] << 16 | data[k + 1] << 8 | data[k + 2]);
  return [view.name, seen.size];
})"""
CURSORS = """[...document.querySelectorAll('#cursors tr')]
  .map((row) => [...row.children].map((cell) => cell.textContent))"""
HEIGHTS = """[...document.querySelectorAll('button')]
  .filter((button) => button.offsetParent).map((button) => button.offsetHeight)"""
UNNAMED = """[...document.querySelectorAll('input, select')]
  .filter((e) => e.type !== 'checkbox' && !e.labels.length && !e.getAttribute('aria-label'))
  .map((e) => e.id)"""
SETTING = "directmpc.settings.find((s) => s.key === '%s').value"
PATIENCE = 60_000
"""For what a busy machine does late, ms."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser without a screen; skipped where there is none, or no driver for it."""
    if BROWSER is None:
        pytest.skip("there is no Chromium: apt install chromium")
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="pip install -r requirements-browser.txt brings the driver"
    )
    with playwright.sync_playwright() as driver:
        one = driver.chromium.launch(
            executable_path=BROWSER, args=["--no-sandbox", "--js-flags=--expose-gc"]
        )
        yield one
        one.close()


class Scope:
    """A scope as a process of its own."""

    def __init__(self, folder: Path, *arguments: str, command: str = "scope") -> None:
        ends = ["--no-browser", "--http", "0"]
        called = [sys.executable, "-m", "directmpc", command, *arguments, *ends]
        environment = os.environ | {
            "PYTHONPATH": str(ROOT / "model"),
            "XDG_CONFIG_HOME": str(folder),
            "DIRECTMPC_SILENT": "1",
        }
        self.process = subprocess.Popen(called, stdout=subprocess.PIPE, env=environment, text=True)
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        assert said.startswith("scope: http://127.0.0.1:"), said
        self.address = said.split()[1]

    def close(self) -> int:
        """End it as Ctrl-C does."""
        self.process.send_signal(2)
        return self.process.wait(timeout=60)

    def memory(self) -> float:
        """What it has in memory, MB."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


class Page:
    """A page of the scope, and what went wrong on it."""

    def __init__(
        self, browser: Any, address: str, width: int = 1500, height: int = 2300, **options: Any
    ) -> None:
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, accept_downloads=True, **options
        )
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.errors: list[str] = []
        self.outside: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda m: m.type == "error" and self.errors.append(m.text))
        self.page.on(
            "request",
            lambda r: (
                r.url.startswith((address.split("#")[0], "blob:", "data:"))
                or self.outside.append(r.url)
            ),
        )
        self.page.goto(address)
        self.until("directmpc.ready && directmpc.views.length > 0")

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.context.close()
        assert not self.errors
        assert not self.outside, "everything comes from the package"

    def get(self, expression: str) -> Any:
        """Value of an expression of the page."""
        return self.page.evaluate(expression)

    def until(self, expression: str, timeout: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + timeout / 1000
        # the page's own policy forbids the driver's way to wait
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, (expression, self.page.inner_text("header"))
            time.sleep(0.02)

    def click(self, what: str, **options: Any) -> None:
        """Click something."""
        self.page.click(what, **options)

    def text(self, what: str) -> str:
        """What something says."""
        return str(self.page.inner_text(what))

    def saved(self, what: str) -> bytes:
        """What a click downloads."""
        with self.page.expect_download() as download:
            self.page.click(what)
        return Path(download.value.path()).read_bytes()

    def draws_all(self) -> list[str]:
        """Show every view; each draws something: more than one colour. Their names."""
        self.click("#shown summary")
        for box in self.page.query_selector_all("#choices input"):
            box.check()
        self.click("#shown summary")
        self.page.set_viewport_size({"width": 1500, "height": 6000})
        self.until("directmpc.views.every((v) => v.visible)")
        self.settle()
        drawn = self.get(COLOURS)
        assert all(colours > 3 for _, colours in drawn), drawn
        return [name for name, _ in drawn]

    def settle(self) -> None:
        """Wait until what is to be drawn has been drawn."""
        self.until("!directmpc.dirty")


# ---- a recorded run ----


@pytest.fixture(scope="module")
def result() -> Any:
    """A run of three periods."""
    return simulate(load_drive("anpc5l_6kv"), "model", steps=STEPS)


@pytest.fixture(scope="module")
def recorded(result: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scope]:
    """A scope of it."""
    folder = tmp_path_factory.mktemp("scope")
    result.write_trace(folder / "trace.csv")
    write_decisions(folder / "decisions.csv", result.decisions)
    one = Scope(
        folder,
        str(folder / "trace.csv"),
        "--decisions",
        str(folder / "decisions.csv"),
        "--drive",
        "anpc5l_6kv",
    )
    yield one
    assert one.close() == 0


def test_every_view_draws_the_run(browser: Any, recorded: Scope, result: Any) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        names = page.draws_all()
        assert {
            "currents",
            "capacitors",
            "neutral",
            "torque",
            "speed",
            "levels",
            "positions",
            "gates",
            "costs",
            "lengths",
            "flags",
            "clocks",
            "faults",
            "histogram",
            "spectrum",
            "xy",
        } <= set(names)
        assert page.get("document.querySelectorAll('.panel canvas').length") == len(names)
        shown = np.array(page.get("[...directmpc.store.part('i_a', 0, 1200)]"))
        assert np.allclose(shown, result.phase_currents[:, 0], atol=1e-6)
        assert page.get("directmpc.store.edges") > 100
        assert "Start" not in page.text("body"), "a run that is over cannot be started"


def test_every_view_draws_a_two_level_drive(browser: Any, tmp_path: Path) -> None:
    result = simulate(load_drive("induction_2kw2"), "model", steps=400)
    files = [tmp_path / "trace.csv", tmp_path / "decisions.csv"]
    result.write_trace(files[0])
    write_two_level(files[1], result.decisions)
    one = Scope(tmp_path, str(files[0]), "--decisions", str(files[1]))
    try:
        with Page(browser, one.address) as page:
            page.until("directmpc.store.total === 400")
            assert {"currents", "link", "torque", "flux", "speed", "costs"} <= set(page.draws_all())
            margin = np.array(page.get("[...directmpc.store.part('margin', 0, 400)]"))
            assert margin.min() >= 0.0
    finally:
        assert one.close() == 0


def test_spectrum_thd_and_xy(browser: Any, recorded: Scope, result: Any) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        page.click("#whole")
        page.settle()
        page.until("Number.isFinite(directmpc.thd)")
        ratio = page.get("directmpc.thd")
        wanted = float(thd(result.phase_currents[:, 0], result.speed, result.drive.ts_pu))
        assert ratio == pytest.approx(wanted, rel=0.02)
        assert f"{100 * ratio:.2f} %" in page.text("#view-spectrum small")
        f, amplitude = page.get("directmpc.views.find((v) => v.name === 'spectrum').plot.data")
        peak = f[int(np.argmax(amplitude))]
        assert peak == pytest.approx(50.0, abs=15.0)
        page.page.select_option("#view-xy [aria-label='xy y']", "v_n")
        page.settle()
        points = page.get("[...directmpc.views.find((v) => v.name === 'xy').points[1]]")
        assert np.allclose(np.array(points) / 4899.0, result.table()["v_n"], atol=1e-5)
        page.page.select_option("#view-spectrum select", "torque")
        page.settle()
        assert "pole pair" in page.text("#view-spectrum small")


def test_zoom_cursors_and_units_by_mouse_and_keys(
    browser: Any, recorded: Scope, result: Any
) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        box = page.page.query_selector("#view-currents .u-over").bounding_box()
        mouse, middle = page.page.mouse, box["y"] + box["height"] / 2
        mouse.move(box["x"] + box["width"] * 0.25, middle)
        mouse.down()
        mouse.move(box["x"] + box["width"] * 0.5, middle, steps=5)
        mouse.up()
        page.until("!directmpc.view.follows && directmpc.view.until - directmpc.view.from < 300")
        first, last = page.get("[directmpc.view.from, directmpc.view.until]")
        assert (first, last) == (pytest.approx(250, abs=8), pytest.approx(500, abs=8))
        page.settle()
        mouse.click(box["x"] + box["width"] * 0.2, middle)
        page.page.keyboard.down("Shift")
        mouse.click(box["x"] + box["width"] * 0.8, middle)
        page.page.keyboard.up("Shift")
        page.until("directmpc.marks.a !== null && directmpc.marks.b !== null")
        for key in ("ArrowRight", "ArrowRight", "Shift+ArrowLeft"):
            page.page.keyboard.press(key)
        a, b = page.get("[directmpc.marks.a, directmpc.marks.b]")
        assert a == pytest.approx(first + 0.2 * (last - first), abs=6)
        assert b == pytest.approx(first + 0.8 * (last - first), abs=6)
        page.until("!directmpc.dirty && directmpc.listed")
        rows = page.get(CURSORS)
        found = next(row for row in rows if row[0] == "i_a A")
        current = result.phase_currents[:, 0] * 139.9
        assert float(found[1]) == pytest.approx(current[a], rel=1e-3)
        assert float(found[2]) == pytest.approx(current[b], rel=1e-3)
        assert float(found[4]) == pytest.approx(current[a:b].mean(), rel=1e-2, abs=0.1)
        page.page.select_option("#units", "1")
        page.until(
            "[...document.querySelectorAll('#cursors th')].some((c) => c.textContent === 'i_a pu')"
        )
        size = page.get("directmpc.view.until - directmpc.view.from")
        page.page.keyboard.press("+")
        assert page.get("directmpc.view.until - directmpc.view.from") < size
        page.page.keyboard.press("-")
        page.click("#narrower")
        assert page.get("directmpc.view.until - directmpc.view.from") < size
        page.click("#wider")
        assert abs(page.get("directmpc.view.until - directmpc.view.from") - size) <= 8
        page.page.keyboard.press("0")
        assert page.get("[directmpc.view.from, directmpc.view.until]") == [0, STEPS]
        mouse.move(box["x"] + box["width"] / 2, middle)
        mouse.wheel(0, -200)
        page.until(f"directmpc.view.until - directmpc.view.from < {STEPS}")


def test_dead_times_are_seen(browser: Any, recorded: Scope) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        page.settle()
        assert "2.00 µs" in page.text("#view-gates small"), "guard.dead_time of the drive file"


def test_trigger_on_a_recorded_signal(browser: Any, recorded: Scope) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        page.page.select_option("#source", "i_a")
        page.page.fill("#level", "50")
        page.click("#arm")
        page.until("document.getElementById('armed').textContent === 'triggered'")
        row = page.get("directmpc.marks.t")
        before, at = (139.9 * page.get(f"directmpc.store.at('i_a', {k})") for k in (row - 1, row))
        assert before < 50 <= at
        page.page.select_option("#edge", "down")
        page.page.fill("#before", "20")
        page.page.select_option("#mode", "normal")
        page.until(f"directmpc.marks.t !== {row} && !directmpc.view.follows")
        row = page.get("directmpc.marks.t")
        before, at = (139.9 * page.get(f"directmpc.store.at('i_a', {k})") for k in (row - 1, row))
        assert before > 50 >= at
        assert row - page.get("directmpc.view.from") == 200


def test_exports(browser: Any, recorded: Scope, result: Any, tmp_path: Path) -> None:
    with Page(browser, recorded.address) as page:
        page.until(f"directmpc.store.total === {STEPS}")
        page.click("#whole")
        page.click("#export summary")
        result.write_trace(tmp_path / "trace.csv")
        assert page.saved("#export a[data-kind=trace]") == (tmp_path / "trace.csv").read_bytes()
        write_decisions(tmp_path / "decisions.csv", result.decisions)
        assert len(page.saved("#export a[data-kind=decisions]").splitlines()) == STEPS + 1
        lines = page.saved("#export a[data-kind=csv]").decode().splitlines()
        assert len(lines) == STEPS + 1
        assert "i_a [A]" in lines[0]
        assert page.saved("#export a[data-kind=fst]")[:1] == b"\0"
        picture = page.saved("#png")
        assert picture[:8] == b"\x89PNG\r\n\x1a\n"
        assert len(picture) > 20_000


def test_presets_are_kept(browser: Any, recorded: Scope) -> None:
    with Page(browser, recorded.address) as page:
        page.page.fill("#span", "200")
        page.page.press("#span", "Enter")
        page.page.select_option("#units", "1")
        page.click("#kept summary")
        page.page.fill("#name", "two hundred")
        page.click("#keep")
        page.until("'two hundred' in directmpc.presets")
    with Page(browser, recorded.address) as page:
        page.click("#kept summary")
        page.page.select_option("#presets", "two hundred")
        page.click("#recall")
        assert page.get("[directmpc.span, directmpc.unit]") == [200, 1]
        page.click("#forget")
        page.until("!('two hundred' in directmpc.presets)")


# ---- a drive that runs ----


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scope]:
    """A scope of the board's RTL."""
    native.write(["mpdcc_board"])
    one = Scope(tmp_path_factory.mktemp("live"), "virtual")
    yield one
    assert one.close() == 130


def running(page: Page, rows: int = 100) -> None:
    """Start the drive by its button and wait for some steps."""
    page.click("#start")
    page.until("directmpc.state.running")
    page.until(f"directmpc.store.total > {page.get('directmpc.store.total') + rows}")


def test_a_drive_is_started_set_and_stopped(browser: Any, live: Scope) -> None:
    with Page(browser, live.address) as page:
        running(page)
        assert "running" in page.text("#status")
        page.page.fill("#set-speed", "20")
        page.page.press("#set-speed", "Enter")
        page.until("Math.abs(directmpc.settings.find((s) => s.key === 'speed').value - 0.4) < 0.01")
        page.page.fill("#set-bound_current", "28")
        page.page.fill("#set-lambda_n", "0.5")
        page.page.press("#set-lambda_n", "Tab")
        page.click("#commit")
        page.until(f"Math.abs({SETTING % 'bound_current'} * 139.9 - 28) < 0.01")
        assert page.get(SETTING % "lambda_n") == 0.5
        # sliders do what the fields do: a reference at once, a parameter with the commit
        page.page.press("#slide-speed", "ArrowLeft")
        slid = float(page.page.input_value("#slide-speed"))
        assert 19 < slid < 20
        page.until(
            "Math.abs(directmpc.settings.find((s) => s.key === 'speed').value"
            f" - {slid} / 50) < 0.001"
        )
        page.page.press("#slide-bound_current", "ArrowRight")
        slid = float(page.page.input_value("#slide-bound_current"))
        assert 28 < slid < 29
        assert abs(float(page.page.input_value("#set-bound_current")) - slid) < 1e-3
        page.click("#commit")
        page.until(f"Math.abs({SETTING % 'bound_current'} * 139.9 - {slid}) < 0.02")
        # the band on the page is the new one, from one step to the next
        last = "directmpc.store.at('%s', directmpc.store.total - 1)"
        page.until(f"{last % 'i_a_high'} - {last % 'i_a_low'} > 0.35")
        page.click("#stop")
        page.until("!directmpc.state.running && directmpc.state.gates === 0")
        assert page.text("#status") == "off"


def test_the_address_of_the_demo_starts_the_drive(browser: Any, live: Scope) -> None:
    with Page(browser, f"{live.address}#start") as page:
        page.until("directmpc.state.running && directmpc.store.total > 20")
        page.click("#stop")
        page.until("!directmpc.state.running")


def test_a_trip_is_seen_with_what_came_before_in_two_clicks(browser: Any, live: Scope) -> None:
    with Page(browser, live.address) as page:
        running(page)
        page.click("#trip")  # what happens to a drive, not one of the two clicks
        page.until("!directmpc.state.running")
        assert "tripped: external_trip" in page.text("#status")
        page.click("#events button.trip")
        page.settle()
        first, last = page.get("[directmpc.view.from, directmpc.view.until]")
        trip = page.get("directmpc.marks.t")
        assert (first, last) == (trip - 20, trip + 2)
        faults = [page.get(f"directmpc.store.at('faults', {k})") for k in (trip - 1, trip)]
        assert (faults, page.get("directmpc.state.gates")) == ([0, 1], 0)
        page.click("#start")
        page.until("!document.getElementById('message').hidden")
        assert "clear them first" in page.text("#message")
        page.click("#clear")
        page.until("document.getElementById('message').hidden")
        running(page, 20)
        page.click("#stop")
        page.until("!directmpc.state.running")


class Tripped:
    """What a scope of a board says after a trip, without a board."""

    recorder, settings = True, ()

    def __init__(self, recording: records.Record) -> None:
        self.recordings, self.given = {1: recording}, Future()
        self.given.set_result(None)

    def state(self) -> dict[str, Any]:
        """A trip, and a recording that has been read."""
        events = [
            {"kind": "trip", "names": ["external_trip"], "row": 399},
            self.recordings[1].events[0] | {"rows": 255, "recording": 1},
        ]
        return {"running": False, "gates": 0, "rate": 0, "error": "", "events": events}

    def give(self, *_: object) -> Future[None]:
        """Every order is carried out."""
        return self.given


def test_a_recording_is_shown_beside_the_run(browser: Any, tmp_path: Path) -> None:
    # a method whose costs the page does not compute
    drive, steps = load_drive("induction_2kw2").with_control(method="GTV"), np.arange(400)
    columns: dict[str, Any] = dict.fromkeys(Signals(drive).columns, np.ones(400))
    columns |= {"is_alpha": np.sin(steps / 9), "u": steps % 8, "next_u": (steps + 1) % 8}
    held = {name: values[:255] for name, values in columns.items()}
    held |= {
        "is_alpha": np.cos(steps[:255] / 9),
        "gates": steps[:255] % 63 + 1,
        "step": steps[:255],
        "faults": np.where(steps[:255] == 254, 1 << FAULTS.index("driver"), 0),
    }
    recording = records.of_recording(drive, held, 254, ["external_trip"])
    live: Any = Tripped(recording)
    own = records.of_columns(drive, columns)
    one = server.Server(own, live, "test", None, server.Presets(tmp_path / "presets.json"))
    http, listening = server.serving(one, "127.0.0.1", 0)
    thread = threading.Thread(target=http.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        with Page(browser, f"http://127.0.0.1:{listening.getsockname()[1]}/") as page:
            page.until("directmpc.own.total === 400")
            page.click("#events button.recorder")
            page.until("directmpc.store.recording")
            page.settle()
            span = "[directmpc.view.from, directmpc.view.until, directmpc.marks.t]"
            assert page.get(span) == [234, 256, 254]
            shown = page.get("[...directmpc.store.part('i_a', 234, 255)]")
            assert np.allclose(shown, np.cos(steps[234:255] / 9), atol=1e-6)
            assert page.get("directmpc.store.edges") > 200, "the gates as they were recorded"
            page.page.set_viewport_size({"width": 1500, "height": 6000})
            page.click("#shown summary")
            page.page.check("#choices input[value=faults]")
            page.until("document.querySelector('#view-faults small')?.textContent === 'driver'")
            page.click("#shown summary")
            page.click("#export summary")
            lines = page.saved("#export a[data-kind=csv]").decode().splitlines()
            assert len(lines) == 22
            assert float(lines[1].split(",")[1]) == pytest.approx(shown[0], abs=1e-6)
            page.click("#events button.trip")
            page.until("!directmpc.store.recording && directmpc.marks.t === 399")
            page.click("#events button.recorder")
            page.until("directmpc.store.recording")
            page.click("#hold")
            page.until("!directmpc.store.recording && directmpc.view.follows")
            page.click("#record")
    finally:
        http.should_exit = True
        thread.join(timeout=20)


def test_single_shot_on_a_fault(browser: Any, live: Scope) -> None:
    with Page(browser, live.address) as page:
        running(page)
        page.page.fill("#span", "60")
        page.page.press("#span", "Enter")
        page.click("#arm")
        assert page.text("#armed") == "armed"
        page.page.fill("#set-vdc", "6000")  # below link_low
        page.page.press("#set-vdc", "Enter")
        page.until("document.getElementById('armed').textContent === 'triggered'")
        assert "link_low" in page.text("#status")
        page.until("!directmpc.view.follows")
        assert page.get("directmpc.marks.t - directmpc.view.from") == 30
        page.page.fill("#set-vdc", "9798")
        page.page.press("#set-vdc", "Enter")
        page.click("#clear")


def test_a_page_that_is_closed_turns_the_drive_off(browser: Any, live: Scope) -> None:
    with Page(browser, live.address) as watching:
        with Page(browser, live.address) as page:
            running(page, 20)
            watching.until("directmpc.state.running")
        watching.until("!directmpc.state.running && directmpc.state.gates === 0", 20_000)


def test_keyboard_alone_and_a_narrow_screen(browser: Any, live: Scope) -> None:
    with Page(browser, live.address, 400, 800, has_touch=True) as page:
        assert page.get("document.documentElement.scrollWidth") <= 400
        for _ in range(40):
            page.page.keyboard.press("Tab")
            if page.get("document.activeElement.id") == "start":
                break
        outline = page.get("getComputedStyle(document.activeElement).outlineStyle")
        assert outline != "none", "where the keyboard is can be seen"
        page.page.keyboard.press("Enter")
        page.until("directmpc.state.running && directmpc.store.total > 20")
        page.page.keyboard.press("Escape")
        page.until("!directmpc.state.running")
        sizes = page.get(HEIGHTS)
        assert min(sizes) >= 24
        small = page.get(
            "[...document.querySelectorAll('.panel')].map((p) => p.getBoundingClientRect().right)"
        )
        assert max(small) <= 400
        unnamed = page.get(UNNAMED)
        assert unnamed == []


def frames(page: Page, seconds: float = 30.0, enough: float = 20.0) -> float:
    """Most frames of a second that the page has drawn, until there are enough."""
    most, end = 0.0, time.monotonic() + seconds
    while most < enough and time.monotonic() < end:
        time.sleep(1.0)
        most = max(most, page.get("directmpc.fps"))
    return most


def test_twenty_frames_a_second(browser: Any, live: Scope) -> None:
    """20 channels of 1,000 points; a busy machine may take some seconds until it can."""
    with Page(browser, live.address, 1500, 1000) as page:
        running(page, 1000)
        shown = page.get(
            "directmpc.views.filter((v) => v.visible).reduce((n, v) => n + v.channels.length, 0)"
        )
        assert shown >= 20
        assert page.get("directmpc.span") == 1000
        found = frames(page)
        page.click("#stop")
        page.until("!directmpc.state.running")
        assert found >= 20


@pytest.mark.parametrize("seconds", [30, pytest.param(1800, marks=pytest.mark.timeout(4000))])
def test_memory_does_not_grow(browser: Any, live: Scope, seconds: int) -> None:
    """MB of page and server at the end of a run and after a third of it: its rings stand then."""
    used = "(gc(), gc(), performance.memory.usedJSHeapSize / 1048576)"
    with Page(browser, live.address, 1500, 1000) as page:
        running(page, 100)
        found = []
        for _ in range(3):
            time.sleep(seconds / 3)
            found.append((page.get(used), live.memory()))
        assert page.get("directmpc.state.running")
        frames = page.get("directmpc.frames")
        page.click("#stop")
        page.until("!directmpc.state.running")
    print(f"{seconds} s, {frames} frames; MB of page and server at each third: {found}")
    assert found[-1][0] - found[0][0] < 0.5
    assert found[-1][1] - found[0][1] < 1.0


def test_the_demo_runs_within_a_minute(browser: Any, live: Scope, tmp_path: Path) -> None:
    """From the command to a drive that is seen to run; `live` has built the board."""
    began = time.monotonic()
    one = Scope(tmp_path, command="demo")
    try:
        with Page(browser, one.address) as page:
            page.until("directmpc.state.running && directmpc.store.total > 100")
            took = time.monotonic() - began
            print(f"a drive runs in the browser {took:.0f} s after directmpc demo")
            page.click("#stop")
            page.until("!directmpc.state.running")
    finally:
        assert one.close() == 130
    assert took < 60


def test_pictures(browser: Any, live: Scope, tmp_path: Path) -> None:
    """The pictures of docs/scope.md."""
    folder = Path(os.environ.get("SCOPE_PICTURES", tmp_path)).absolute()
    with Page(browser, live.address, 1400, 1000) as page:
        running(page, 2500)
        page.page.screenshot(path=folder / "scope.png")
        page.click("#trip")
        page.until("!directmpc.state.running")
        page.click("#events button.trip")
        page.page.query_selector("#view-gates").scroll_into_view_if_needed()
        page.settle()
        time.sleep(1.0)
        page.page.screenshot(path=folder / "scope-trip.png")
        page.click("#clear")
    for name in ("scope.png", "scope-trip.png"):
        assert (folder / name).stat().st_size > 30_000
