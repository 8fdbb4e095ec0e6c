"""The Makefile's own promises: list of targets, messages, exit codes, clean output.

Stimulus: make in a scratch directory with a copy of the Makefile and a stand-in for Python that
prints its arguments, so that nothing of the environment is touched.
Does not prove: what the started programs do.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from directmpc.output_files import OutputError
from scripts.commands import bitstream, netlist, pnr, synth
from scripts.shared import tools

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def project(tmp_path):
    root = tmp_path / "a project"
    (root / "scripts").mkdir(parents=True)
    (root / "work dir").mkdir()
    shutil.copy(ROOT / "Makefile", root)
    (root / "locks").mkdir()
    (root / "locks/requirements.txt").write_text("")
    (root / "locks/requirements-proofs.txt").write_text("")
    setup = root / "scripts" / "setup.sh"
    setup.write_text(
        "#!/bin/sh\necho chatter on stdout\nmkdir -p .venv/bin\n"
        'printf \'#!/bin/sh\\nfor a in "$@"; do echo "<$a>"; done\\n\' > .venv/bin/python\n'
        "chmod +x .venv/bin/python\ntouch .venv/.ready\n"
    )
    setup.chmod(0o755)
    (root / "drive.toml").write_text("")
    (root / "work dir" / "trace 1.csv").write_text("")
    return root


def make(root: Path, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = ["make", "--no-print-directory", *arguments]
    # the variables of a make that runs these tests are not those of the make that is tested
    given = {"MAKEFLAGS", "MAKEOVERRIDES", "MFLAGS", "ARGS", "SEEDS", "JOBS"}
    environment = {name: value for name, value in os.environ.items() if name not in given}
    return subprocess.run(
        command, cwd=cwd or root, capture_output=True, text=True, check=False, env=environment
    )


REPLAY = ("replay", "DRIVE=drive.toml", "IN=work dir/trace 1.csv", "OUT=work dir/out 1.csv")


def test_help_is_the_default_and_lists_every_target(project):
    done = make(project)
    assert done.returncode == 0
    targets = (
        "run test lint replay registers synth budgets check pnr sweep report fidelity sources clean"
    )
    targets += " setup generate format site help mutate"
    for target in targets.split():
        assert f"make {target} " in done.stdout
    assert not (project / ".venv").exists(), "help needs no environment"


def test_replay_passes_paths_with_blanks_and_the_defaults(project):
    done = make(project, *REPLAY)
    assert done.returncode == 0, done.stderr
    expected = [
        "-m",
        "scripts",
        "replay",
        "--drive",
        "drive.toml",
        "--trace",
        "work dir/trace 1.csv",
    ]
    expected += ["--out", "work dir/out 1.csv", "--engine", "rtl", "--explorers", "2"]
    expected += ["--variant", "fast"]
    assert [line.strip("<>") for line in done.stdout.splitlines()] == expected


def test_replay_takes_absolute_paths(project):
    trace = project / "work dir" / "trace 1.csv"
    done = make(project, *REPLAY, f"IN={trace}", f"OUT={project / 'out.csv'}", "ENGINE=ideal")
    assert done.returncode == 0, done.stderr
    assert f"<{trace}>" in done.stdout
    assert "<ideal>" in done.stdout


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("DRIVE=", "DRIVE is not set"),
        ("IN=", "IN is not set"),
        ("OUT=", "OUT is not set"),
        ("ENGINE=magic", "ENGINE is 'magic', but has to be one of: rtl ghdl model ideal"),
        ("EXPLORERS=9", "EXPLORERS is '9'"),
        ("EXPLORERS=2 3", "EXPLORERS is '2 3'"),
        ("VARIANT=other", "VARIANT is 'other'"),
    ],
)
def test_replay_says_what_is_wrong(project, change, message):
    done = make(project, *REPLAY, change)
    assert done.returncode != 0
    assert message in done.stderr
    assert "<" not in done.stdout, "nothing may be started"


def test_waves_are_recorded_where_they_are_asked_for(project):
    for given, handed in (([], []), (["WAVES=0"], []), (["WAVES=1"], ["--waves"])):
        done = make(project, "run", *given, "ARGS=--steps 5")
        words = [line.strip("<>") for line in done.stdout.splitlines()]
        assert words == ["-m", "scripts", "run", *handed, "--steps", "5"]


def test_seeds_and_layouts_reach_the_programs(project):
    done = make(project, "bitstream", "BOARD=ulx3s-85f", "SEEDS=3")
    assert "<--seeds>\n<3>\n" in done.stdout
    done = make(project, "-s", "netlist", "BOARD=arty-s7-50", "CONTROLLER=mptc")
    expected = ["-m", "scripts", "netlist", "--board", "arty-s7-50", "--controller", "mptc"]
    assert [line.strip("<>") for line in done.stdout.splitlines()] == expected
    done = make(project, "registers", "DRIVE=drive.toml", "ARGS=--clock 20e6")
    assert done.stdout.splitlines()[-3:] == ["<drive.toml>", "<--clock>", "<20e6>"]


@pytest.mark.parametrize(
    ("program", "arguments"),
    [
        (pnr, ["--seeds", "0"]),
        (pnr, ["no such name"]),
        (synth, ["no such name"]),
        (synth, ["--families", "none"]),
        (netlist, ["--board", "none"]),
        (bitstream, ["--board", "ulx3s-85f", "--seeds", "0"]),
    ],
)
def test_what_cannot_be_meant_ends_with_code_2(program, arguments, capsys):
    with pytest.raises(SystemExit, match="2"):
        program.cli.main(arguments)
    said = capsys.readouterr().err
    assert said.startswith(f"{program.cli.name}: ")
    assert said.count("\n") == 1


def test_writers_follow_links_and_refuse_what_is_no_file(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "file")
    tools.write(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text(encoding="utf-8") == "text"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="ordinary file"):
        tools.write(tmp_path / "pipe", "text")
    assert (tmp_path / "pipe").is_fifo()


def test_set_up_chatter_does_not_reach_stdout(project):
    first = make(project, "-s", "sources", "TOP=x")
    again = make(project, "-s", "sources", "TOP=x")
    assert first.returncode == 0, first.stderr
    assert first.stdout == again.stdout == "<-m>\n<scripts>\n<sources>\n<x>\n"
    assert "chatter" in first.stderr
    assert "chatter" not in again.stderr


def test_the_site_installs_its_own_packages_once(project):
    (project / "locks/requirements-site.txt").write_text("")
    make(project, "setup")
    first = make(project, "site", "ARGS=--out there")
    again = make(project, "site")
    assert first.returncode == 0, first.stderr
    assert first.stdout == "<-m>\n<scripts>\n<site>\n<--out>\n<there>\n"
    assert "<pip>\n<install>\n" in first.stderr
    assert "requirements-site.txt>" in first.stderr
    assert again.stdout == "<-m>\n<scripts>\n<site>\n"
    assert "<pip>" not in again.stderr


def test_dask_is_installed_once_and_on_demand_only(project):
    (project / "locks/requirements-cluster.txt").write_text("")
    without = make(project, "setup")
    first = make(project, "cluster")
    again = make(project, "cluster")
    assert "requirements-cluster.txt>" not in without.stderr
    assert first.returncode == 0, first.stderr
    assert "requirements-cluster.txt>" in first.stderr
    assert "<pip>" not in again.stderr


def test_all_tests_run_without_the_packages_of_site_and_cluster(project):
    make(project, "setup")
    done = make(project, "test-all")
    assert done.returncode == 0, done.stderr
    assert "packages of the site cannot be installed" in done.stderr
    assert "packages of the cluster cannot be installed" in done.stderr
    assert "<pytest>" in done.stdout


def test_exit_code_is_the_program_s(project):
    make(project, "setup")
    python = project / ".venv" / "bin" / "python"
    python.write_text("#!/bin/sh\nexit 3\n")
    for target in (
        "run",
        "test",
        "lint",
        "synth",
        "budgets",
        "check",
        "pnr",
        "sweep",
        "report",
        "generate",
    ):
        assert make(project, target).returncode != 0, target
    assert make(project, *REPLAY).returncode != 0
    assert make(project, "sources", "TOP=x").returncode != 0


def test_sources_needs_a_top(project):
    done = make(project, "-s", "sources")
    assert done.returncode != 0


def test_registers_show_their_options_without_a_drive(project):
    assert make(project, "registers").returncode != 0
    done = make(project, "registers", "ARGS=--help")
    assert done.returncode == 0, done.stderr
    assert "<--help>" in done.stdout


def test_makefile_from_elsewhere(project, tmp_path):
    other = tmp_path / "elsewhere"
    other.mkdir()
    (other / "t.csv").write_text("")
    # setup.sh of the stand-in works in its own directory only
    make(project, "setup")
    plain = tmp_path / "plain"
    shutil.copytree(project, plain, symlinks=True)
    command = ["-f", str(plain / "Makefile"), "replay"]
    done = make(
        plain, *command, f"DRIVE={plain / 'drive.toml'}", "IN=t.csv", "OUT=o.csv", cwd=other
    )
    assert done.returncode == 0, done.stderr
    assert "<t.csv>" in done.stdout
