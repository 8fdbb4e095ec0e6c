"""The times of a newcomer's first steps come from the output of the script that takes them.

Stimulus: output as the script prints it, among lines of other programs; output that ends early, or
whose beginning is cut off.
Checks: the stored times, the page's table, and that nothing is stored of a run that failed. The
script prints the lines that are read here.
Does not prove: the times themselves, which need a bare machine.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from scripts.commands import newcomer as command
from scripts.publish import newcomer
from scripts.shared.command import InputError
from scripts.shared.tools import ROOT

OUTPUT = f"""setup: ready
newcomer: `make run`: make --no-print-directory run
newcomer: took 12 s: `make run`
something else took 3 s: it
newcomer: took 0 s: a drive file\r
newcomer: all steps work: Debian GNU/Linux 12 (bookworm), 2 cores, commit {"a" * 40}
"""


@pytest.fixture
def two_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A script of two steps."""
    script = tmp_path / "newcomers_path.sh"
    script.write_text(
        "step '`make run`' make run\nstep 'a drive file' make \\\n  drive\n"
        "with_the_wheel() {\n  step 'pip' pip\n  step 'FMPy' python\n}\n",
        "utf-8",
    )
    monkeypatch.setattr(newcomer, "SCRIPT", script)


def test_times_are_stored_and_shown(tmp_path: Path, two_steps: None) -> None:
    log, path, page = tmp_path / "log", tmp_path / "newcomer.json", tmp_path / "page.md"
    log.write_text(OUTPUT, "utf-8")
    page.write_bytes(newcomer.PAGE.read_bytes())
    newcomer.keep(log, path)
    first = {
        "system": "Debian GNU/Linux 12 (bookworm)",
        "cores": 2,
        "commit": "a" * 40,
        "seconds": {"`make run`": 12, "a drive file": 0},
    }
    assert json.loads(path.read_text("utf-8")) == {"newcomer": first}
    log.write_text(OUTPUT.replace("`make run`", "pip").replace("a drive file", "FMPy"), "utf-8")
    newcomer.keep(log, path, "wheel")
    second = first | {"seconds": {"pip": 12, "FMPy": 0}}
    assert json.loads(path.read_text("utf-8")) == {"newcomer": first, "wheel": second}
    newcomer.page(page, path)
    text = page.read_text("utf-8")
    assert "bare Debian GNU/Linux 12 (bookworm) with 2 cores, at commit `aaaaaaaaaaaa`:" in text
    assert "| `make run` | 12 |\n| a drive file | 0 |\n| all | 12 |\n" in text
    assert "| pip | 12 |\n| FMPy | 0 |\n| all | 12 |\n" in text


def test_a_run_that_failed_is_not_stored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, path = tmp_path / "log", tmp_path / "newcomer.json"
    path.write_text("as it was", "utf-8")
    log.write_text(OUTPUT.split("newcomer: all steps work")[0], "utf-8")
    with pytest.raises(InputError, match="no line 'newcomer: all steps work'"):
        newcomer.keep(log, path)
    assert path.read_text("utf-8") == "as it was"
    before = newcomer.TIMES.read_bytes(), newcomer.PAGE.read_bytes()
    assert command.cli.main(["--log", str(tmp_path / "none")]) == 2
    assert f"newcomer: {tmp_path / 'none'}: No such file" in capsys.readouterr().err
    assert (newcomer.TIMES.read_bytes(), newcomer.PAGE.read_bytes()) == before


def test_output_without_its_beginning_is_not_stored(tmp_path: Path, two_steps: None) -> None:
    log, path = tmp_path / "log", tmp_path / "newcomer.json"
    log.write_text(OUTPUT.partition("something else")[2], "utf-8")
    with pytest.raises(InputError, match="no time of the step `make run`; all of the output"):
        newcomer.keep(log, path)
    assert not path.exists()


def test_the_script_prints_what_is_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    script = (ROOT / "scripts" / "newcomers_path.sh").read_text("utf-8")
    names = [li.split("'")[1] for li in script.splitlines() if li.startswith("  step '")]
    known = json.loads(newcomer.TIMES.read_text("utf-8"))
    stored = [name for way in newcomer.WAYS if way in known for name in known[way]["seconds"]]
    assert names[: len(stored)] == stored
    assert len(names) == 10
    step = script[script.index("step() {") : script.index("on_a_virtual_board() {")]
    done = script[script.index("printf 'newcomer: all steps") :]
    ran = subprocess.run(
        ["bash", "-c", f"{step}\nstep 'one of two' true\n{done}"],
        check=True, capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    own = tmp_path / "own.sh"
    own.write_text("step 'one of two' true\n\nwith_the_wheel() {\n", "utf-8")
    monkeypatch.setattr(newcomer, "SCRIPT", own)
    assert list(newcomer.times(ran.stdout)["seconds"]) == ["one of two"]
