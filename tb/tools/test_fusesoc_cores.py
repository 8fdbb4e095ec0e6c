"""FuseSoC builds every public entity from its core file, and designs that depend on several.

Sweep: every core file of rtl/; an own design on two cores, with and without generics of the same
names.
Checks: FuseSoC finds the core, GHDL analyses and elaborates it in the library directmpc with the
generics that are given; a core that is a dependency sets no generic; every file is compiled once
and after all it needs, in one version of VHDL; the files are what `make generate` makes; a file
that is missing in the list is seen.
Does not prove: that other tools than GHDL take the cores through FuseSoC.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from scripts.generate import fusesoc_cores as cores
from scripts.hdl import sources
from scripts.shared import tools

EXAMPLE = tools.ROOT / "examples" / "own_bench.vhd"
#: What these pages name as parts of something else.
INSIDE: set[str] = set()
#: What the own design adds to the example: a guard behind the core.
GUARD = """
  i_guard : entity directmpc.gate_guard
    port map (clk => clk, rst => rst, enable => enable, external_trip => '0',
      clear => (others => '0'),
      measured => enable, is_alpha => x"3700", is_beta => x"EFBD", v_dc => x"7D0D",
      v_n => x"01E6", v_ph_a => x"3C6D", v_ph_b => x"3D49", v_ph_c => x"4013",
      omega_r => x"3E2D", start => start,
      decided => decided, position_a => s_a, position_b => s_b, position_c => s_c, renew => '0',
      dead_time => x"00A", minimum_on => x"00A", minimum_off => x"00A",
      decision_limit => x"FFFF", watchdog => x"FFFF", current_limit => x"6000",
      link_high => x"9000", link_low => x"0001", v_ph_high => x"5000", v_ph_low => x"3000",
      v_n_limit => x"2000", speed_limit => x"5000", frozen_limit => x"00", gates => gates,
      running => running, waits => open,
      resting => open, taken_a => open, taken_b => open, taken_c => open, faults => open);

  decided <= valid when rising_edge(clk);
  enable <= not rst when rising_edge(clk);
"""
SIGNALS = """
  signal enable, decided, running : std_logic := '0';
  signal gates : std_logic_vector(23 downto 0);
"""
SEEN = """
    for k in 1 to 20 loop
      wait until rising_edge(clk);
    end loop;
    assert running = '1'
      report "the guard does not follow the core"
      severity failure;
    report "own generics " & integer'image(EXPLORERS) & " " & boolean'image(SECOND_LEVEL);
"""


def build(
    core: str, roots: Path | list[Path], work: Path, *arguments: str
) -> subprocess.CompletedProcess[str]:
    """Set up, build and run one core with the GHDL of all tests, whatever its command."""
    (work / "bin").mkdir()
    script = work / "bin" / "ghdl"
    command = shlex.join([shutil.which(tools.tool("ghdl")[0]) or "", *tools.tool("ghdl")[1:]])
    script.write_text(f'#!/bin/sh\nexec {command} "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    where = f"{work / 'bin'}{os.pathsep}{os.environ['PATH']}"
    run = [sys.executable, "-m", "fusesoc.main"]
    for root in [roots] if isinstance(roots, Path) else roots:
        run += ["--cores-root", str(root)]
    run += ["run", "--target", "sim", "--work-root", str(work / "build")]
    run += ["--setup", "--build", "--run", core, *arguments]
    return subprocess.run(
        run, cwd=work, env={**os.environ, "PATH": where}, capture_output=True, text=True,
        timeout=900, check=False,
    )  # fmt: skip


def own_design(folder: Path, generics: str) -> Path:
    """A design of a user: the example's bench of a core, and a guard behind it."""
    text = EXAMPLE.read_text(encoding="utf-8").replace("entity work.", "entity directmpc.")
    for before, after in (
        ("entity own_bench is\n", f"library directmpc;\n\nentity own_bench is\n{generics}"),
        ("\nbegin\n", f"{SIGNALS}\nbegin\n{GUARD}"),
        ("    ended <= true;\n", f"{SEEN}    ended <= true;\n"),
    ):
        assert text.count(before) >= 1
        text = text.replace(before, after, 1)
    folder.mkdir()
    (folder / "own_bench.vhd").write_text(text, encoding="utf-8")
    content = {
        "name": "me:designs:own:1.0",
        "filesets": {
            "rtl": {
                "files": ["own_bench.vhd"],
                "file_type": "vhdlSource-93",
                "depend": ["directmpc:cores:mpdcc_core", "directmpc:cores:gate_guard"],
            }
        },
        "targets": {
            "sim": {
                "filesets": ["rtl"],
                "toplevel": "own_bench",
                "default_tool": "ghdl",
                "tools": {"ghdl": {"run_options": ["--ieee-asserts=disable"]}},
            }
        },
    }
    text = "CAPI=2:\n" + yaml.dump(content, sort_keys=False)
    (folder / "own.core").write_text(text, encoding="utf-8")
    return folder


def test_every_core_file_is_a_public_entitys() -> None:
    wanted = {entity: cores.core(entity) for entity in (*cores.PUBLIC, cores.SHELL)}
    wanted[cores.COMMON] = cores.common()
    found = {path.stem: path.read_text(encoding="utf-8") for path in cores.RTL.glob("*.core")}
    assert found == wanted


def test_what_pages_ask_an_integrator_to_use_has_a_core() -> None:
    named = set()
    for page in ("safety", "processor", "boards", "using-the-core", "start-fpga"):
        text = (tools.ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        asked = text.split("What an integrator must do")[-1].split("\n## ")[0]
        named |= set(re.findall(r"`(\w+)`", asked if page == "safety" else text))
    asked = named & set(sources.entities()) - INSIDE
    assert {"gate_release", "sync_bits", "clock_monitor"} <= asked
    assert asked <= set(cores.PUBLIC)


def test_every_file_stands_in_one_core_and_only_wrappers_are_vhdl_2008() -> None:
    seen = []
    for path in sorted(cores.RTL.glob("*.core")):
        fileset = yaml.safe_load(path.read_text(encoding="utf-8"))["filesets"]["rtl"]
        assert fileset["logical_name"] == "directmpc"
        # FuseSoC 2.4.7 refuses a list without entries, and every design that needs the core
        assert fileset.get("files") != []
        for row in fileset.get("files", []):
            [(name, given)] = row.items()
            wraps = sources.is_wrapper(cores.RTL / name)
            assert given == {"file_type": "vhdlSource-2008" if wraps else "vhdlSource-93"}
            assert not wraps or path.stem != cores.COMMON
            seen.append(name)
    assert len(seen) == len(set(seen))
    assert {cores.RTL / name for name in seen} == set(cores.owners())


@pytest.mark.parametrize("entity", sorted(cores.PUBLIC))
def test_fusesoc_builds_it(entity: str, tmp_path: Path) -> None:
    done = build(f"directmpc:cores:{entity}", cores.RTL, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Running" in done.stderr


def test_a_file_that_is_missing_is_seen(tmp_path: Path) -> None:
    root = tmp_path / "rtl"
    shutil.copytree(cores.RTL, root)
    path = root / "gate_guard.core"
    text = path.read_text(encoding="utf-8")
    lost = "    - guard/gate_leg.vhd:\n        file_type: vhdlSource-93\n"
    assert text.count(lost) == 1
    path.write_text(text.replace(lost, ""), encoding="utf-8")
    done = build("directmpc:cores:gate_guard", root, tmp_path)
    assert done.returncode != 0
    assert "gate_leg" in done.stderr


@pytest.mark.parametrize("own", ["none", "same names"])
def test_a_design_depends_on_two_cores(own: str, tmp_path: Path) -> None:
    generics = "  generic (EXPLORERS : positive := 6; SECOND_LEVEL : boolean := true);\n"
    design = own_design(tmp_path / "own", generics if own == "same names" else "")
    if own == "none":
        path = design / "own_bench.vhd"
        text = re.sub(r'    report "own generics .*\n', "", path.read_text(encoding="utf-8"))
        path.write_text(text, encoding="utf-8")
    done = build("me:designs:own", [cores.RTL, design], tmp_path)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert "positions 7, 3, 0 after 68 clocks" in said
    assert ("own generics 6 true" in said) == (own == "same names")
    assert "also defined" not in said
    assert "obsolete" not in said
    check_order(tmp_path / "build")


def check_order(work: Path) -> None:
    """Each file of a build is there once, in one version of VHDL; in turn, GHDL takes them all."""
    [path] = work.glob("*.eda.yml")
    files = yaml.safe_load(path.read_text(encoding="utf-8"))["files"]
    names = [file["name"].split("/", 2)[-1] for file in files]
    assert len(names) == len(set(names))
    assert {file["file_type"] for file in files} == {"vhdlSource-93"}
    turn = work / "turn"
    turn.mkdir()
    for file in files:
        library = file.get("logical_name", "work")
        done = subprocess.run(
            [*tools.tool("ghdl"), "-a", "--std=93", f"--work={library}", f"--workdir={turn}",
             f"-P{turn}", str(work / file["name"])],
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert not done.stderr
    # A package that is analysed again makes what used it obsolete: elaboration tells.
    done = subprocess.run(
        [*tools.tool("ghdl"), "-e", "--std=93", f"--workdir={turn}", f"-P{turn}", "own_bench"],
        cwd=turn, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
