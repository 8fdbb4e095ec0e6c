"""The mutation score: mutants, the benches that run them, results that are kept, and the page.

Stimulus: small VHDL with every kind of place that may change, and with all that may not; a project
of one entity with a bench that looks at everything, or at little; runs that are interrupted,
sources and benches that change; lists with mistakes.
Checks: every kind of mutant; the same ones each time; comments, texts, assertions and generics as
they were; a weak bench leaves survivors, a good one none; what is killed by time, and what does not
compile; a proof of equality, and none where there is a difference; a run goes on where it stopped;
results that are void are run again, and no other's; the page has what is kept; the packages of
another converter are changed, and its benches asked.
Faults: the weak bench is the good one without a part.
Does not prove: that the kinds of mutants are those of real mistakes.
"""

from __future__ import annotations

import gzip
import json
import re
import shutil
import types
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from scripts.__main__ import main
from scripts.hdl import equivalence, sources
from scripts.hdl.mutants import KINDS, Mutant, code, mutants, shuffled
from scripts.measure import bench_server, mutation, proofs
from scripts.measure.mutation import Unit
from scripts.publish import entity_pages
from scripts.shared import tables, tools
from scripts.shared.tools import ROOT

SOURCE = """-- a <= b and '1' when 1 else 0;
library ieee;
  use ieee.std_logic_1164.all;

entity small is
  generic (
    WIDTH : positive range 1 to 4 := 2 -- 3 and 4
  );
  port (
    clk : in std_logic; -- rst = '1'
    go  : in std_logic;
    q   : out std_logic_vector(WIDTH - 1 downto 0) := "01"
  );
begin
  assert WIDTH < 4 report "1 and 2" severity failure;
end entity small;

architecture rtl of small is

  type pair_t is record
    a : natural range 0 to 3;
    b : std_logic;
  end record pair_t;

  constant TABLE : bits_t := (0 => '1', 1 => '0', 2 => "0110", 3 => x"A5");
  constant LAST  : natural := 7;
  signal   r     : pair_t;

begin

  assert LAST = 7 report "and 'or' not" severity failure;

  q <= "10" when r.b = '1' and go = '1' else
       std_logic_vector(to_unsigned(r.a - 1, 2));

  p_count : process (clk) is
  begin
    if rising_edge(clk) then
      if (go = '1' and not r.b'stable) then -- go or r.b
        r.a <= r.a + 1; report "1 < 2";
      end if;
      if (rst = '1') then
        r.a <= 0;
      end if;
    end if;
  end process p_count;

  i_one : entity work.one
    generic map (
      WIDTH => 3
    )
    port map (
      clk => clk,
      go  => go,
      q   => q
    );

end architecture rtl;
"""


def changes(kind: str) -> list[tuple[str, str]]:
    """Lines before and after the mutants of a kind."""
    return [(one.before, one.after) for one in mutants(SOURCE) if one.kind == kind]


# --- the mutants ----------------------------------------------------------------------------------


GATE = "if (go = '1' and not r.b'stable) then"
OUTPUT = "q <= \"10\" when r.b = '1' and go = '1' else"
ENTRIES = "constant TABLE : bits_t := (0 => {}, 1 => '0', 2 => {}, 3 => {});"
WHOLE = ENTRIES.format("'1'", '"0110"', 'x"A5"')


@pytest.mark.parametrize(
    ("kind", "before", "after"),
    [
        ("operator", GATE, "if (go /= '1' and not r.b'stable) then"),
        ("operator", GATE, "if (go = '1' or not r.b'stable) then"),
        ("operator", GATE, "if (go = '1' and r.b'stable) then"),
        ("operator", GATE, "if (not r.b'stable) then"),
        ("operator", GATE, "if (go = '1') then"),
        ("operator", "std_logic_vector(to_unsigned(r.a - 1, 2));",
         "std_logic_vector(to_unsigned(r.a + 1, 2));"),
        ("constant", OUTPUT, "q <= \"11\" when r.b = '1' and go = '1' else"),
        ("constant", "constant LAST : natural := 7;", "constant LAST : natural := 8;"),
        ("constant", "constant LAST : natural := 7;", "constant LAST : natural := 6;"),
        ("constant", "WIDTH => 3", "WIDTH => 4"),
        ("condition", GATE, "if (true) then"),
        ("condition", GATE, "if (false) then"),
        ("condition", OUTPUT, "q <= \"10\" when (true) else"),
        ("condition", "if (rst = '1') then", "if (false) then"),
        ("reset", "r.a <= 0;", "null;"),
        ("dropped", 'r.a <= r.a + 1; report "1 < 2";', 'null; report "1 < 2";'),
        ("table", WHOLE, ENTRIES.format("'0'", '"0110"', 'x"A5"')),
        ("table", WHOLE, ENTRIES.format("'1'", '"0111"', 'x"A5"')),
        ("table", WHOLE, ENTRIES.format("'1'", '"0110"', 'x"A4"')),
        ("wiring", "go => go,", "go => q,"),
    ],
)  # fmt: skip
def test_every_kind_of_place_changes(kind: str, before: str, after: str) -> None:
    blank = re.compile(r"\s+")
    found = [(blank.sub("", a), blank.sub("", b)) for a, b in changes(kind)]
    assert (blank.sub("", before), blank.sub("", after)) in found


def test_nothing_else_changes() -> None:
    kept = [
        *re.findall(r"--[^\n]*", SOURCE),
        *re.findall(r"assert[^;]*;|report[^;]*;", SOURCE),
        SOURCE[SOURCE.index("entity small is") : SOURCE.index("end entity small;")],
        SOURCE[SOURCE.index("type pair_t") : SOURCE.index("end record pair_t;")],
        "if rising_edge(clk) then",
        "clk => clk,",
    ]
    found = mutants(SOURCE)
    assert {one.kind for one in found} == set(KINDS)
    for one in found:
        changed = one.applied(SOURCE)
        assert changed != SOURCE
        assert all(text in changed for text in kept), one
    assert len({one.applied(SOURCE) for one in found}) == len({one.name for one in found})
    assert len(found) == len({one.name for one in found})


def test_mutants_are_the_same_each_time() -> None:
    found = mutants(SOURCE)
    assert found == mutants(SOURCE)
    first = shuffled(found, 1)
    assert first == shuffled(found, 1) != shuffled(found, 2)
    assert sorted(first, key=lambda m: m.name) == sorted(found, key=lambda m: m.name)
    # the kinds come in turn
    assert {one.kind for one in first[: len(KINDS)]} == set(KINDS)


def test_comments_move_a_mutant_and_do_not_rename_it() -> None:
    moved = SOURCE.replace("begin\n\n  assert LAST", "begin\n  -- one\n  -- two\n\n  assert LAST")
    assert code(moved) == code(SOURCE)
    pairs = list(zip(mutants(SOURCE), mutants(moved), strict=True))
    assert all(a.name == b.name for a, b in pairs)
    assert {b.line - a.line for a, b in pairs} == {0, 2}


def test_every_file_of_the_design_has_mutants() -> None:
    for unit in mutation.listed():
        source = (ROOT / unit.file).read_text(encoding="utf-8")
        found = mutants(source)
        assert found, unit.file
        for one in shuffled(found, 1)[:2]:
            assert code(one.applied(source)) != code(source), unit.file


# --- the list -------------------------------------------------------------------------------------


def test_the_units_of_the_list_are_the_designs(tmp_path: Path) -> None:
    listed = {unit.name: unit for unit in mutation.listed()}
    files = {path.relative_to(ROOT) for path in (ROOT / "rtl").rglob("*.vhd")}
    assert {unit.file for unit in listed.values()} <= files
    assert not any("generated" in unit.file.parts for unit in listed.values())
    assert listed["binary_search"].tests == ("tb/rtl/mpdcc/binary_search",)
    assert set(mutation.unlisted([])) == set(mutation.unlisted(listed.values())) | set(listed)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[nothing]", "mutation.toml: nothing: no unit of the design"),
        ("[ram]\nbench = []", "ram: unknown key 'bench'; there are: tests, above"),
        ("[countdown]", "countdown: there is no folder of tests of that name; name 'tests'"),
        ('[ram]\ntests = ["tb/none.py::test_a"]', "ram: there is no test 'tb/none.py::test_a'"),
        ('[ram]\nabove = "tb"', r"ram\.above: a list of texts is needed"),
        ("[ram", "mutation.toml: "),
    ],
)
def test_a_mistake_in_the_list_is_named(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "mutation.toml"
    path.write_text(text)
    with pytest.raises(mutation.MutationError, match=said):
        mutation.listed(path)


def test_netlists_are_compared_with_each_option_and_without_it() -> None:
    seen = 0
    for unit in mutation.listed():
        rows = mutation.kept(unit.name).get("mutants", ())
        proven = any(row["outcome"] == "equivalent" for row in rows)
        if not unit.top or not (proven or unit.configurations != ({},)):
            continue
        text = sources.entities()[unit.top].read_text(encoding="utf-8")
        for generic in entity_pages.generics(text, unit.top):
            if generic.kind.lower() == "boolean":
                default = generic.default == "true"
                given = {each.get(generic.name, default) for each in unit.configurations}
                assert given == {False, True}, f"{unit.name}: {generic.name} is always {given}"
                seen += 1
    assert seen >= 20


RAILS = "constant RAIL_GATES"


def test_proofs_of_the_list_are_there() -> None:
    known = {f"{proof.entity}-{name}" for proof in proofs.listed() for name in proof.configurations}
    graphs = proofs.of_converter("fc3l", proofs.listed())
    known |= {f"fc3l-{proof.entity}-{name}" for proof in graphs for name in proof.configurations}
    units = [*mutation.listed(), *mutation.of_converter("fc3l", mutation.listed())]
    named = [test for unit in units for test in (*unit.tests, *unit.above) if "_holds[" in test]
    assert len(named) >= 20
    assert {test.partition("[")[2].rstrip("]") for test in named} <= known


def test_a_unit_has_the_packages_of_a_converter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (unit,) = mutation.of_converter("npc3l", mutation.listed())
    graph, *_ = unit.tests
    monkeypatch.setattr(
        mutation, "mutants",
        lambda text: [m for m in mutants(text) if m.after.startswith(("(0, 2, 2, 2)", RAILS))],
    )  # fmt: skip
    # what is proven of the candidates says nothing of the gates
    with mutation.workshop() as place:
        unit = replace(unit, tests=(graph,))
        found = mutation.mutate(unit, place, 9, tmp_path, place.root)["mutants"]
    told = {(row["before"].startswith(RAILS), row["outcome"]) for row in found}
    assert told == {(False, "killed"), (True, "survived")}


def test_arguments_are_about_mutants_that_there_are() -> None:
    files = {unit.name: unit.file for unit in mutation.listed()}
    for one in mutation.arguments():
        names = {m.name for m in mutants((ROOT / files[one.unit]).read_text(encoding="utf-8"))}
        assert one.name in names, f"{mutation.ARGUED.name}: {one.unit} has no mutant {one.name}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[ram]]\nmutants = [["a", "b"]]', "ram: 'why' and 'mutants' are needed"),
        ('[[ram]]\nmutants = []\nwhy = "c"\nline = 3', "ram: .* not 'line'"),
        ('[[ram]]\nmutants = ["ab"]\nwhy = "c"', "ram: ab is no line"),
        ('[[ram]]\nmutants = [["a"]]\nwhy = "c"', r"ram: \['a'\] is no line before and after"),
        ('[[ram]]\nmutants = [["a", "b", "1"]]\nwhy = "c"', "ram: .* is no line"),
    ],
)
def test_a_mistake_in_an_argument_is_named(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "argued.toml"
    path.write_text(text)
    with pytest.raises(mutation.MutationError, match=said):
        mutation.arguments(path)


def test_the_command_names_what_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mutate", "nothing"]) != 0
    assert "mutate: 'nothing' is not in mutation.toml; there are: " in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["mutate", "--sample", "0"])
    assert "argument --sample: got 0; at least 1 is needed" in capsys.readouterr().err


# --- results --------------------------------------------------------------------------------------

COUNTER = """library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity counter is
  port (
    clk  : in    std_logic;
    rst  : in    std_logic;
    go   : in    std_logic;
    hold : in    std_logic;
    q    : out   std_logic_vector(1 downto 0)
  );
end entity counter;

architecture rtl of counter is

  signal n : unsigned(1 downto 0);

begin

  p_count : process (clk) is
  begin

    if rising_edge(clk) then
      if (go = '1' and hold = '0') then
        n <= n + 1;
      end if;

      if (rst = '1') then
        n <= (others => '0');
      end if;
    end if;

  end process p_count;

  q <= std_logic_vector(n);

end architecture rtl;
"""
BENCH = '''"""Cocotb side."""
import random
import cocotb
from tb.helpers.stepping import compare

class Counter:
    n = 0
    def outputs(self, given):
        return {"q": self.n}
    def edge(self, given):
        self.n = 0 if given["rst"] else (self.n + (given["go"] and not given["hold"])) % 4

@cocotb.test()
async def random_counts(dut):
    inputs = {"go": 0.5, "hold": HOLD}
    board = await compare(dut, Counter(), inputs, rng=random.Random(1), clocks=200)
    board.finish({"q": 100})
'''
TEST = '''"""Bench of a counter."""
from pathlib import Path
from tb.helpers.faults import altered
from tb.helpers.simulation import run

RTL = Path(__file__).resolve().parents[4] / "rtl"

def test_it_counts():
    run("counter", "tb.rtl.common.counter.bench_counter", units=["counter"], rtl=RTL)

def test_a_fault_is_seen(tmp_path):
    altered(tmp_path, "counter", "no such text", "")
'''
#: The test that kills.
COUNTS = "tb/rtl/common/counter/test_counter.py::test_it_counts"


def project(folder: Path, hold: float = 0.5) -> Path:
    """A project of one entity; its bench holds the counter with this probability."""
    root = folder / "project"
    place = root / "tb" / "rtl" / "common" / "counter"
    place.mkdir(parents=True)
    for name in ("scripts", "model", "converters", "drives", "pyproject.toml"):
        (root / name).symlink_to(ROOT / name)
    (root / "tb" / "helpers").symlink_to(ROOT / "tb" / "helpers")
    (root / "rtl" / "common").mkdir(parents=True)
    (root / "rtl" / "common" / "counter.vhd").write_text(COUNTER)
    (place / "bench_counter.py").write_text(BENCH.replace("HOLD", str(hold)))
    (place / "test_counter.py").write_text(TEST)
    (root / "tb" / "mutation.toml").write_text("[counter]\n")
    return root


def unit_of(root: Path) -> Unit:
    """The unit of such a project."""
    return mutation.listed(root / "tb" / "mutation.toml", root)[0]


def outcomes(root: Path, sample: int) -> dict[tuple[str, str], str]:
    """What comes of its mutants, none proven to be equal."""
    unit = unit_of(root)
    unit = Unit(unit.name, unit.file, unit.tests, unit.above, "", unit.configurations)
    with mutation.workshop(root) as place:
        found = mutation.mutate(unit, place, sample, root / "results", root)
    return {(row["before"], row["after"]): row["outcome"] for row in found["mutants"]}


def test_a_weak_bench_leaves_survivors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed = ("if (go = '1') then", "if (false) then")  # two of them, to be quick
    monkeypatch.setattr(
        mutation, "mutants", lambda text: [m for m in mutants(text) if m.after in changed]
    )
    found = outcomes(project(tmp_path, hold=0), 40)
    line = "if (go = '1' and hold = '0') then"
    assert (found[line, changed[0]], found[line, changed[1]]) == ("survived", "killed")


def test_a_good_bench_leaves_none(tmp_path: Path) -> None:
    found = outcomes(project(tmp_path), 40)
    assert len(found) > 10
    assert set(found.values()) <= {"killed", "uncompiled"}


def test_benches_that_fail_without_a_change_are_an_error(tmp_path: Path) -> None:
    root = project(tmp_path)
    path = root / "tb" / "rtl" / "common" / "counter" / "bench_counter.py"
    path.write_text(BENCH.replace("HOLD", "0.5").replace("% 4", "% 3"))
    with pytest.raises(mutation.MutationError, match="counter: its benches do not pass without"):
        outcomes(root, 2)


def test_what_a_failure_means() -> None:
    ends = {
        "uncompiled": bench_server.BuildError("x"),
        "broken": FileNotFoundError("x"),
        "failed": AssertionError("x"),
    }
    assert {end: bench_server.end_of(error) for end, error in ends.items()} == {
        end: end for end in ends
    }

    def seeds(tmp_path: Path) -> None:
        assert_seen(tmp_path)  # noqa: F821

    assert bench_server.seeds_faults(seeds)
    assert not bench_server.seeds_faults(test_what_a_failure_means)


@pytest.mark.parametrize(
    ("body", "limits"),
    [
        ("subprocess.run(['timeout', '60', 'sleep', '59'], check=True)", (1, 60)),
        ("subprocess.run(['sh', '-c', 'while true; do :; done'], check=True)", (60, 0.5)),
    ],
    ids=["clock", "processor"],
)
def test_a_bench_that_does_not_end_is_ended(
    body: str, limits: tuple[float, float], tmp_path: Path
) -> None:
    root = project(tmp_path)
    path = root / "tb" / "rtl" / "common" / "counter" / "test_counter.py"
    path.write_text(f"import subprocess\n\n\ndef test_it_ends():\n    {body}\n")
    with mutation.workshop(root) as place:
        found = place.run([str(path.relative_to(root))], *limits)
    assert found["end"] == "timeout"
    assert found["seconds"] < 50
    assert found["work"] >= 0.5 or limits[0] == 1


def test_tests_go_in_order_and_each_has_a_limit(tmp_path: Path) -> None:
    root = project(tmp_path)
    path = root / "tb" / "rtl" / "common" / "counter" / "test_counter.py"
    path.write_text(
        "def test_one():\n    pass\n\n\ndef test_two():\n    pass\n\n\n"
        "def test_busy():\n    while True:\n        pass\n"
    )
    name = str(path.relative_to(root))
    first = [f"{name}::test_{test}" for test in ("two", "busy")]
    with mutation.workshop(root) as place:
        found = place.run([name], one=0.5, first=first)
        assert place.run([f"{name}::test_one"], first=first)["end"] == "passed"
    assert (found["end"], found["test"]) == ("timeout", first[1])
    assert list(found["each"]) == first
    assert found["each"][first[0]] < 0.5 <= found["each"][first[1]]


def test_a_test_that_kills_quickly_goes_first(tmp_path: Path) -> None:
    killers = {"a": ("slow", 5), "b": ("slow", 5), "c": ("quick", 1)}
    known = [
        {"before": name, "after": "", "place": 1, "by": by} for name, (by, _) in killers.items()
    ]
    judge = mutation._Judge.__new__(mutation._Judge)
    judge.killer = {(row["before"], "", 1): row["by"] for row in known}
    judge.kills, judge.spent = Counter(judge.killer.values()), {}
    each = {"never": 0.1, **dict(killers.values())}
    of = {name: Mutant("operator", 0, 0, "", 1, name, "", 1) for name in "abcd"}
    # one that takes little is tried, until it has failed too often
    assert judge._order(of["d"], each) == ["never", "quick", "slow"]
    judge.spent["never"] = 20.0
    assert judge._order(of["d"], each) == ["quick", "slow", "never"]
    assert judge._order(of["a"], each) == ["slow", "quick", "never"]
    # a long test that kills at its begin goes before a short one that kills at its end
    judge.kills.update(slow=10, quick=10)
    judge.spent |= {"slow": 3.0, "quick": 10.0}
    assert judge._order(of["d"], each) == ["slow", "quick", "never"]


def test_equality_is_proven_where_it_holds_only(tmp_path: Path) -> None:
    rtl = tmp_path / "counter.vhd"
    rtl.write_text(COUNTER)

    def equal(old: str, new: str, *questions: str) -> bool:
        assert old in COUNTER
        other = tmp_path / "other" / "counter.vhd"
        other.parent.mkdir(exist_ok=True)
        other.write_text(COUNTER.replace(old, new))
        asked = questions or (equivalence.REGISTERS, equivalence.OUTPUTS)
        return equivalence.equal("counter", {}, [rtl], [other], tmp_path, asked)

    assert equal("n + 1", "1 + n", equivalence.REGISTERS)
    assert equal("n + 1", "1 + n", equivalence.OUTPUTS)
    assert not equal("n + 1", "n + 2", equivalence.REGISTERS)
    assert not equal("n + 1", "n + 2", equivalence.OUTPUTS)
    assert equal("n <= n + 1", "n <= n - 3")
    assert equal("(go = '1' and hold = '0')", "((go and not hold) = '1')")
    assert not equal("n + 1", "n + 2")
    assert not equal(" and hold = '0'", "")
    assert not equal("n <= (others => '0')", "n <= (others => '1')")


# --- results that are kept ------------------------------------------------------------------------


class StandIn:
    """Judges by a rule, counts, and stops after so many."""

    judged = 0
    stop: int | None = None

    def __init__(self, *_: object) -> None:
        pass

    def judge(self, mutant: Mutant) -> tuple[str, str] | None:
        """A part is killed, one in five does not compile."""
        if StandIn.judged == StandIn.stop:
            raise KeyboardInterrupt
        StandIn.judged += 1
        place = mutant.start % 5
        outcome = ("uncompiled", "killed", "killed", "survived", "timeout")[place]
        return outcome, COUNTS if outcome in ("killed", "timeout") else ""


@pytest.fixture
def judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Runs the project's entity with the stand-in; how many were judged."""
    root = project(tmp_path)
    monkeypatch.setattr(mutation, "_Judge", StandIn)

    def _run(sample: int = 8, stop: int | None = None, *, anew: bool = False) -> int:
        StandIn.judged, StandIn.stop = 0, stop
        mutation.mutate(unit_of(root), None, sample, root / "results", root, anew=anew)
        return StandIn.judged

    return _run


def rows(root: Path) -> list[dict[str, object]]:
    """What is kept of the counter."""
    return mutation.kept("counter", root / "results")["mutants"]


def test_a_run_goes_on_where_it_stopped(judged: Callable[..., int], tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        judged(stop=5)
    folder = tmp_path / "project" / "results"
    assert [path.name for path in folder.iterdir()] == ["counter.json.gz"]
    before = rows(folder.parent)
    assert len(before) == 5
    assert mutation.kept("counter", folder)["whole"] is False
    more = judged()
    whole = rows(folder.parent)
    assert more == len(whole) - 5
    assert all(row in whole for row in before)
    assert mutation.kept("counter", folder)["whole"] is True
    assert sum(row["outcome"] != "uncompiled" for row in whole) == 8
    assert judged() == 0
    assert judged(sample=9) >= 1
    assert judged(anew=True) == len(whole)


def test_what_its_own_benches_do_not_notice_comes_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, asked = project(tmp_path), []
    # of the first that comes above there is an argument, and one for another unit
    second = [one.name for one in shuffled(mutants(COUNTER), mutation.SEED)][1]
    reasons = [mutation.Argument("counter", second, ""), mutation.Argument("other", (), "")]
    monkeypatch.setattr(mutation, "arguments", lambda: reasons)

    class Two(StandIn):
        def judge(self, mutant: Mutant) -> tuple[str, str] | None:
            asked.append(("own", mutant.name))
            return ("killed", COUNTS) if len(asked) % 2 else None

        def judge_on(self, mutant: Mutant, *, argued: bool) -> tuple[str, str]:
            assert argued == (mutant.name == reasons[0].name)
            asked.append(("above", mutant.name))
            return ("uncompiled" if len(asked) == 9 else "equivalent"), ""

    monkeypatch.setattr(mutation, "_Judge", Two)
    found = mutation.mutate(unit_of(root), None, 6, root / "results", root)
    assert [kind for kind, _ in asked] == ["own"] * 6 + ["above"] * 3
    assert [name for _, name in asked[6:]] == [name for _, name in asked[1:6:2]]
    assert asked[6][1] == second
    ends = [row["outcome"] for row in found["mutants"]]
    assert sorted(ends) == ["equivalent"] * 2 + ["killed"] * 3 + ["uncompiled"]
    assert found["whole"] is False, "one of six does not count"
    found = mutation.mutate(unit_of(root), None, 6, root / "results", root)
    assert (len(asked), found["whole"]) == (11, True)


@pytest.mark.parametrize("argued", [True, False])
def test_yosys_is_not_asked_for_what_is_argued(
    argued: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def _equal(*given: object) -> bool:
        asked.extend(given[-1])
        return equivalence.OUTPUTS in given[-1]

    monkeypatch.setattr(mutation.equivalence, "equal", _equal)
    root = project(tmp_path)
    place = types.SimpleNamespace(root=root)
    (tmp_path / "judge").mkdir()
    judge = mutation._Judge(unit_of(root), place, tmp_path / "judge")
    found = judge.judge_on(mutants(COUNTER)[0], argued=argued)
    # the slow question is the one whose answer is "equal" here; none is asked twice
    assert found == (("survived" if argued else "equivalent"), "")
    assert asked == ([] if argued else [equivalence.REGISTERS, equivalence.OUTPUTS])


def test_a_changed_source_or_bench_makes_results_void(
    judged: Callable[..., int], tmp_path: Path
) -> None:
    first, root = judged(), tmp_path / "project"
    source = root / "rtl" / "common" / "counter.vhd"
    lines = [row["line"] for row in rows(root)]
    source.write_text("-- a comment\n" + COUNTER)
    assert mutation.outdated([unit_of(root)], root / "results", root) == []
    assert judged() == 0
    assert [row["line"] for row in rows(root)] == [line + 1 for line in lines]
    source.write_text(COUNTER.replace("n + 1", "1 + n"))
    assert mutation.outdated([unit_of(root)], root / "results", root) == ["counter"]
    assert judged() >= 8
    bench = root / "tb" / "rtl" / "common" / "counter" / "bench_counter.py"
    bench.write_text(bench.read_text() + "# more\n")
    assert judged() >= 8
    source.write_text(COUNTER)
    assert judged() == first


def test_results_hold_as_long_as_what_they_depend_on(tmp_path: Path) -> None:
    root = project(tmp_path)
    above = root / "tb" / "above"
    above.mkdir()
    (above / "test_above.py").write_text("\n")
    (root / "tb" / "mutation.toml").write_text('[counter]\nabove = ["tb/above/test_above.py"]\n')
    unit = unit_of(root)
    found = {
        "keys": mutation.keys_of(unit, root),
        "mutants": [
            kept_row("uncompiled", "1"),
            kept_row("equivalent", "2"),
            kept_row("killed", "3") | {"by": COUNTS},
            kept_row("timeout", "4") | {"by": "tb/above/test_above.py::test_it[1]"},
            kept_row("survived", "5"),
            kept_row("killed", "6") | {"by": "tb/elsewhere/test_it.py::test_it"},
        ],
    }

    def held(unit: Unit = unit) -> str:
        rows = mutation.valid(unit, found, mutation.keys_of(unit, root))
        return "".join(str(row["after"]) for row in rows)

    assert held() == "12345"
    # netlists that were not compared in all configurations
    wider = Unit(unit.name, unit.file, unit.tests, unit.above, unit.top, ({"WIDTH": 3},))
    assert held(wider) == "1345"
    (above / "test_above.py").write_text("# more\n")
    assert held() == "123"
    (above / "test_above.py").write_text("\n")
    bench = root / "tb" / "rtl" / "common" / "counter" / "bench_counter.py"
    text = bench.read_text()
    bench.write_text(text + "# more\n")
    assert held() == "124"
    bench.write_text(text)
    # a test that is added asks the survivors, and nothing else
    (bench.parent / "test_added.py").write_text("\n")
    assert held() == "1234"
    (bench.parent / "test_added.py").unlink()
    alone = Unit(unit.name, unit.file, unit.tests, (), unit.top, unit.configurations)
    assert held(alone) == "123"
    (root / unit.file).write_text(COUNTER.replace("n + 1", "1 + n"))
    assert held() == ""


def test_results_that_are_none_are_told(tmp_path: Path) -> None:
    for broken in (b"{", gzip.compress(b"{"), gzip.compress(b"{}")[:-9]):
        (tmp_path / "ram.json.gz").write_bytes(broken)
        with pytest.raises(mutation.MutationError, match=r"ram\.json\.gz: .*; remove it to begin"):
            mutation.kept("ram", tmp_path)
    assert mutation.kept("countdown", tmp_path) == {}


# --- the page -------------------------------------------------------------------------------------


def kept_row(outcome: str, after: str) -> dict[str, object]:
    """A result."""
    return {
        "line": 3, "kind": "operator", "before": "a | b", "after": after, "place": 1,
        "outcome": outcome,
    }  # fmt: skip


def test_scores_are_counted() -> None:
    ends = ("killed", "killed", "timeout", "uncompiled", "equivalent", "survived", "survived")
    found = {"whole": True, "mutants": [kept_row(end, str(k)) for k, end in enumerate(ends)]}
    argued = [mutation.Argument("ram", ("a | b", "6", 1), "because")]
    score = mutation.score("ram", found, argued)
    assert (score.mutants, score.killed, score.equivalent, len(score.survivors)) == (6, 3, 2, 1)
    units = [one for one in mutation.listed() if one.name in ("ram", "sync_bits")]
    page = mutation.markdown(units, {"ram": found}, argued)
    assert "| `ram` | 6 | 3 | 1 | 1 | 1 | 1 | 75 % |" in page
    assert "| `sync_bits` | not run |" in page
    assert "| `ram.vhd:3` | `a \\| b` | `5` |\n" in page
    assert "| `ram.vhd:3` | `a \\| b` | `6` | because |" in page
    assert mutation.share(0, 0) == "-"
    figures = mutation.figures(mutation.scores({"ram": found, "a": {"mutants": []}}, argued))
    assert figures["ram"] == {"mutants": 6, "equivalent": 2, "killed_pct": 75.0}
    assert figures["a"] == {"mutants": 0, "equivalent": 0}
    page = mutation.markdown(units, {"ram": found | {"whole": False}}, argued)
    assert "| `ram`, so far | 6 | 3 | 1 | 1 | 1 | 1 | 75 % |" in page


def test_the_page_has_what_is_kept() -> None:
    page = tables.inside(mutation.PAGE.read_text(encoding="utf-8"), *mutation.MARKS)
    units = mutation.listed()
    found = mutation.stored(units)
    assert page.strip() == mutation.markdown(units, found, mutation.arguments())
    assert {path.name.removesuffix(".json.gz") for path in mutation.RESULTS.iterdir()} == set(found)
    told = mutation.scores(found, mutation.arguments())
    assert mutation.PAGE.with_suffix(".svg").read_text() == mutation.badge(told, len(units))
    metrics = json.loads(mutation.METRICS.read_text(encoding="utf-8"))
    assert metrics["mutation"] == mutation.figures(told)


def test_publishing_runs_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page, results = tmp_path / "page.md", tmp_path / "results"
    metrics = tmp_path / "metrics.json"
    metrics.write_text('{"commit": "x"}')
    where = ["--page", str(page), "--out", str(results), "--metrics", str(metrics)]
    page.write_text("\n".join(mutation.MARKS) + "\n")
    results.mkdir()
    row = json.dumps(kept_row("killed", "a & b"))
    tools.write(results / "ram.json.gz", f'{{"keys": {{}}, "mutants": [{row}]}}')
    assert main(["mutate", "--publish", *where]) == 0
    figures = {"mutants": 1, "equivalent": 0, "killed_pct": 100.0}
    assert json.loads(metrics.read_text()) == {"commit": "x", "mutation": {"ram": figures}}
    assert f">100 %, 1 of {len(mutation.listed())} units<" in page.with_suffix(".svg").read_text()
    assert "| `ram`, so far | 1 | 1 |" in page.read_text()
    assert "mutate: changed since they were run: ram" in capsys.readouterr().err
    shutil.rmtree(results)
    assert main(["mutate", "--publish", *where]) == 0
    assert json.loads(metrics.read_text())["mutation"] == {}
    assert ">-, 0 of " in page.with_suffix(".svg").read_text()
    assert "| `ram` | not run |" in page.read_text()
