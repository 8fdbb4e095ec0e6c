"""Recorder of control steps: ring, triggers, registers.

Stimulus: random records, both controllers' sizes, at full speed and with pauses; any settings;
trips and commands within decisions and between them; reads without a pause beside steps at full
speed.
Checks: every record that can be read, status and settings, against the model; responses; data
stands until it is taken, and nothing is added to another's.
Faults: words, rows, triggers, edges, counts and the bus's answers go wrong.
Does not prove: that what is another's passes the bus unchanged: the proof does.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from directmpc.host import recorder
from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, controller: str = "mpdcc", seed: int = 1, sessions: int = 72) -> Outcome:
    inputs, results = recorder.words(controller)
    return run(
        "recorder",
        "tb.rtl.system.recorder.bench_recorder",
        units=["recorder"],
        generics={"ROWS_LOG2": 3, "INPUTS": inputs, "RESULTS": results},
        arguments={"seed": seed, "sessions": sessions},
        rtl=rtl,
    )


@pytest.mark.parametrize("controller", recorder.FIELDS)
@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_recorded_is_what_the_model_has(controller: str, seed: int) -> None:
    outcome = bench(controller=controller, seed=seed)
    assert outcome.measured["read"] > 3  # some wait for a record's words


def test_it_has_no_output_but_the_bus() -> None:
    """So the proofs of its bus say all that it can do to a decision, a gate or a trip."""
    entity = (
        (RTL / "system" / "recorder.vhd").read_text(encoding="utf-8").partition("end entity")[0]
    )
    outputs = re.findall(r"^ +(\w+) *: out ", entity, re.M)
    bus = r"(aw|w|b|ar|r)(valid|ready|data|resp)"
    assert len(outputs) > 10
    assert [name for name in outputs if not re.fullmatch(f"[ms]_{bus}|own_data", name)] == []
    shell = (RTL / "system" / "system_shell.vhd").read_text(encoding="utf-8")
    wired = dict(
        re.findall(r"(\w+) +=> (\w+)", shell.partition("i_recorder :")[2].partition(");")[0])
    )
    added = {"own_data": "recorded", "m_rdata": "recorded_data"}
    for name in outputs:
        assert wired[name] in (name, name.replace("m_", "heard_"), added.get(name))
    for signal in added.values():
        assert re.findall(rf"=> {signal}\b", shell.partition("i_recorder :")[0]) == [f"=> {signal}"]


STATUS = "status|record"

FAULTS = [
    Fault("recorder", "words(i) <= step_words(32 * i + 31 downto 32 * i);",
          "words(i) <= step_words(31 downto 0);", "record"),
    Fault("recorder", "if (r.place(i) = '1') then", "if (false) then", "record"),
    Fault("recorder", "v.row  := r.row + 1;", "v.row  := r.row + 2;", "status"),
    Fault("recorder", "r.full or to_std_logic(r.row = 2 ** ROWS_LOG2 - 1)", "r.full", "status"),
    Fault("recorder", "tripped and not r.tripped and", "tripped and", "status"),
    Fault("recorder", "r.known and not r.above and above", "not r.above and above", STATUS),
    Fault("recorder", "r.known and r.above and not above", "r.known and not above", STATUS),
    Fault("recorder", "and above and not higher)", "and above and higher)", STATUS),
    Fault("recorder", "not b.settings(SETTINGS_NO_SIGN);", "b.settings(SETTINGS_NO_SIGN);",
          STATUS),
    Fault("recorder", "kept := r.whole and (r.fires or r.grid);", "kept := r.whole and r.grid;",
          STATUS),
    Fault("recorder", "if (r.skip = decimation) then", "if (r.skip + 1 = decimation) then",
          STATUS),
    Fault("recorder", "if (r.count = behind) then", "if (r.count + 1 = behind) then", "status"),
    Fault("recorder", "if (b.looks = '0') then\n            v.fetched := '1';",
          "if (true) then\n            v.fetched := '1';", "read taken|record"),
    Fault("recorder", "r.ends and deadlock and", "r.ended and deadlock and", STATUS),
    Fault("recorder", "SETTLES    : positive := 4;", "SETTLES    : positive := 3;", STATUS),
    Fault("recorder", "if (rst = '1' or b.arm = '1') then", "if (rst = '1') then", "status"),
    Fault("recorder", "v.wrong := '1';", "v.wrong := '0';", "write answered"),
    Fault("recorder", "or (b.looks and not rests)", "", "read taken"),
    Fault("recorder", " or (b.shows and not m_rready)", "", "data stands"),
    Fault("recorder", "(b.shows and not m_rready)", "b.shows", "data of another"),
    Fault("recorder", "own_data  <= b.answered;", "own_data  <= b.there;", "own data"),
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
