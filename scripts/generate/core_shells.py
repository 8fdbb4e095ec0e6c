"""Writes the flat shells around the cores: entities whose ports are std_logic and vectors of it.

Inside, the cores have records as ports. Vendors' tools, netlists and other languages want flat
ports. A shell copies ports to the fields of records and back, and does nothing else. What a shell
looks like stands in ``SHELLS``; a port is written once, with its comment.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from directmpc.mpdcc import formats as f
from scripts.shared import tools

#: Most characters of a line.
_LINE = 120
_RTL = Path(__file__).resolve().parents[2] / "rtl"


@dataclass(frozen=True)
class Port:
    """One flat port."""

    name: str
    width: str  #: Upper bound of the vector, ``15`` or ``WORD_WIDTH - 1``; empty: std_logic.
    comment: str  #: Unit, format or polarity, for the end of the line.
    #: Field of the record it is copied to or from; empty: the port goes to the inner port of its
    #: name, or, in a group, to the field of its name. Beginning with a parenthesis: an element of
    #: an array.
    field: str = ""
    #: Type of the field, ``signed`` or ``unsigned``; empty: the type of the port.
    convert: str = ""


@dataclass(frozen=True)
class Group:
    """Ports that belong together."""

    #: Line above the group, which begins new columns; empty: the group goes on with those of the
    #: one before.
    comment: str
    ports: tuple[Port, ...]
    output: bool = False  #: Whether they are outputs.
    #: Inner port that is a record or an array, and its type; empty: the ports are the inner
    #: entity's own. Two groups may share a record.
    record: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Shell:
    """A shell."""

    #: Names of the shell and of what it wraps; room of the file below ``rtl/``.
    entity: str
    inner: str
    folder: str
    header: str  #: The shell's manual, without comment dashes.
    packages: tuple[str, ...]  #: Packages of library work that are used.
    generics: tuple[tuple[str, str, str, str], ...]  #: (name, type, default, comment).
    groups: tuple[Group, ...]
    #: (name, value): generics of the inner entity that the shell sets.
    fixed: tuple[tuple[str, str], ...] = ()
    #: (name, value): ports of the inner entity that the shell has not: a constant, or ``open`` for
    #: an output.
    tied: tuple[tuple[str, str], ...] = ()

    @property
    def path(self) -> Path:
        """File of the shell."""
        return _RTL / self.folder / f"{self.entity}.vhd"


_CLOCK = (
    Port("clk", "", "rising edge"),
    Port("rst", "", "synchronous, active high"),
    Port("start", "", "'1' for one clock: decide; ignored while busy"),
)

#: What each measurement of MPDCC is, where it is not like the one before.
_MEASURED = {
    "is_alpha": "stator current, ",
    "psir_alpha": "rotor flux, ",
    "v_n": "neutral point, ",
    "v_ph_a": "capacitor, ",
    "v_dc": "dc-link, ",
    "iref_alpha": "current reference, ",
    "omega_s": "stator frequency, ",
    "omega_r": "rotor speed, ",
}
_WIDTHS = {
    "CURRENT": f.CURRENT,
    "FLUX": f.FLUX,
    "SPEED": f.SPEED,
    "NEUTRAL_VOLTAGE": f.NEUTRAL_VOLTAGE,
    "CAPACITOR_VOLTAGE": f.CAPACITOR_VOLTAGE,
    "LINK_VOLTAGE": f.LINK_VOLTAGE,
}
#: Coefficients of MPDCC in register order, below what each block of them has in common.
_COEFFICIENTS = {
    "parameters from a drive file, stable from start to valid; coefficients signed, scaled": (
        ("error_alpha", "(iref - is) to trajectory units"),
        ("error_beta", "the same times sqrt(3)/2"),
        ("error_neutral", "-v_n to trajectory units"),
        ("error_phase", "(v_dc/4 - v_ph) to trajectory units"),
        ("stator_alpha", "h/tau_s"),
        ("stator_beta", "h/tau_s * sqrt(3)/2"),
        ("rotor_alpha", "-h*Xm/(D*tau_r)"),
        ("rotor_beta", "-h*Xm/(D*tau_r) * sqrt(3)/2"),
        ("reference_alpha", "-h"),
        ("reference_beta", "h * sqrt(3)/2"),
        ("emf_alpha", "-h*Xm/D"),
        ("emf_beta", "h*Xm/D * sqrt(3)/2"),
        ("correction_alpha", "-p*L*h**2"),
        ("correction_beta", "-p*L*h**2 * sqrt(3)/2"),
        ("forced_voltage", "h*Xr/(3*D), for v_dc/2 and v_ph"),
        ("forced_neutral", "h*Xr/(3*D), for v_n"),
        ("phase_alpha", "h/X_ph"),
        ("phase_beta", "h/X_ph * sqrt(3)/2"),
        ("midpoint_alpha", "h/(2*X_dc)"),
        ("midpoint_beta", "h/(2*X_dc) * sqrt(3)/2"),
        ("weight", "sqrt(lambda_n)"),
        ("weight_alpha", "-sqrt(lambda_n)*h/(2*X_dc)"),
        ("weight_beta", "-sqrt(3*lambda_n)*h/(4*X_dc)"),
    ),
    "likewise, factors of the curvature; fast variant alone": (
        ("curvature_emf_alpha", "of omega_r*psi_r"),
        ("curvature_emf_beta", "the same, beta"),
        ("curvature_flux_alpha", "of omega_r**2*psi_r"),
        ("curvature_flux_beta", "the same, beta"),
        ("curvature_reference_alpha", "of omega_s**2*iref"),
        ("curvature_reference_beta", "the same, beta"),
    ),
    "likewise, for SESE and the prediction alone": (
        ("change_phase", "h/X_ph * 16"),
        ("change_midpoint", "h/(2*X_dc) * 16"),
        ("change_weight", "-sqrt(lambda_n)*h/(2*X_dc)"),
        ("error_forced", "-h*Xr/(3*D)"),
    ),
}


def _measurement(name: str, word: f.Format) -> Port:
    """A measurement of MPDCC: its width by name, its scale from the formats."""
    width = next(key for key, value in _WIDTHS.items() if value is word)
    kind = "signed" if word.signed else "unsigned"
    text = f"{_MEASURED.get(name, '')}{kind}, 1/{word.scale:.10g} pu"
    return Port(name, f"{width}_WIDTH - 1", text, name, kind)


def _parameter(name: str, comment: str) -> Port:
    """A coefficient of MPDCC: an element of the array."""
    return Port(f"c_{name}", "COEFFICIENT_WIDTH - 1", comment, f"(FACTOR_{name.upper()})")


def _position(name: str, phase: int, step: str, field: str) -> Port:
    text = f"switch position s({step}) of phase {'abc'[phase]}, 0 to 7"
    return Port(name, "2", text, f"{field}({phase})", "unsigned")


MPDCC = Shell(
    entity="mpdcc_core",
    inner="mpdcc_controller",
    folder="mpdcc",
    header="""\
Model predictive direct current control of a multilevel drive (Paper A): the core.

One scheduler and EXPLORERS explorers.  Give the measurements with a one-clock start; valid comes
with the switch position for this step.  docs/specification.md says what is decided: hold while
every output stays inside its bound, else the candidate of least switching effort per step of
validity.

Formats: per unit with the scales at each port; parameters as directmpc.mpdcc.coefficients
computes them from a drive file, in units of that drive.
Latency: fast 21 clocks when held, at most 112, 82, 73 with one to three explorers and 70 with
more; paper 28 when held, at most 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS.  One decision at
a time; the next start may come one clock after valid.
With two_switchings (SESE, SECOND_LEVEL) a search takes at most 3470, 1928, 1755 with one to three
explorers and 1191 with more; compensate adds 30 clocks to a hold and 33 to a search.
Where no candidate stays inside its bounds the decision is the candidate of the least largest
excess at k+1.  With deadlock_rule (WEIGHTED_DEADLOCK) the excess of v_n counts eight times and a
sixteenth of the currents' largest is added, see step_one and docs/settings.md.  It takes no
clock more.
What is outside its bound at k makes a candidate dead.  With outside_inwards (INWARDS) it is
followed while it comes back, see docs/specification.md, section 2.4.  It takes no clock more.
Overflow: saturates and sets saturated; nothing wraps.
FOLDED = true excludes SECOND_LEVEL, WEIGHTED_DEADLOCK and INWARDS; elaboration fails with one.
Considered and rejected: rtl/alternatives.md.""",
    packages=("converter_leg", "directmpc_constants", "mpdcc_types"),
    generics=(
        ("EXPLORERS", "positive range 1 to 8", "2", "number of explorers"),
        ("FOLDED", "boolean", "false", "true: the paper's explorer, false: the fast one"),
        (
            "SECOND_LEVEL",
            "boolean",
            "false",
            "true: SESE and delay compensation, fast explorer alone",
        ),
        (
            "WEIGHTED_DEADLOCK",
            "boolean",
            "false",
            "true: the weighted deadlock rule, fast explorer alone",
        ),
        ("INWARDS", "boolean", "false", "true: the rule inwards, fast explorer alone"),
    ),
    groups=(
        Group("", _CLOCK),
        Group(
            "measurements, sampled with start",
            tuple(_measurement(name, word) for name, word in f.MEASUREMENTS.items()),
            record="measurement",
            kind="measurement_t",
        ),
        Group(
            "where the switches are, sampled with start",
            tuple(_position(f"s_prev_{x}", i, "k-1", "") for i, x in enumerate("abc")),
            record="previous",
            kind="positions_t",
        ),
        *(
            Group(
                text,
                tuple(_parameter(name, comment) for name, comment in block),
                record="coefficients",
                kind="coefficients_t",
            )
            for text, block in _COEFFICIENTS.items()
        ),
        Group(
            "bounds, stable from start to valid",
            (
                *(
                    Port(
                        f"bound_{name}",
                        "BOUND_WIDTH - 1",
                        "unsigned, trajectory units",
                        convert="unsigned",
                    )
                    for name in ("current", "neutral", "phase")
                ),
                Port(
                    "horizon", "LENGTH_WIDTH - 1", "N, unsigned, steps, 1 to 63", convert="unsigned"
                ),
                Port(
                    "weight_scale",
                    "1",
                    "weight on v_n: 14, 16, 18, 20 fraction bits",
                    convert="unsigned",
                ),
            ),
            record="limits",
            kind="limits_t",
        ),
        Group(
            "of SECOND_LEVEL, WEIGHTED_DEADLOCK and INWARDS, stable from start to valid",
            (
                Port("two_switchings", "", "'1': SESE, SECOND_LEVEL only; '0': SE"),
                Port(
                    "budget",
                    "BUDGET_WIDTH - 1",
                    "candidates of the second level, 0: no limit",
                    convert="unsigned",
                ),
                Port(
                    "compensate",
                    "",
                    "'1': decide for k+1, SECOND_LEVEL only",
                ),
            ),
            record="options",
            kind="options_t",
        ),
        Group(
            "",
            (
                Port(
                    "deadlock_rule",
                    "",
                    "'1': weighted, WEIGHTED_DEADLOCK only",
                ),
                Port("outside_inwards", "", "'1': followed inwards, INWARDS only"),
            ),
            record="limits",
            kind="limits_t",
        ),
        Group(
            "decision, stable until the next valid",
            (
                Port("valid", "", "'1' for one clock: decision is new"),
                Port("busy", "", "'1': a decision is under way"),
            ),
            output=True,
        ),
        Group(
            "",
            (
                *(_position(f"s_{x}", i, "k", "position") for i, x in enumerate("abc")),
                Port("held", "", "'1': s(k-1) was kept"),
                Port("deadlock", "", "'1': no candidate stays inside its bounds"),
                Port(
                    "length",
                    "LENGTH_WIDTH - 1",
                    "L* of the choice, steps; else 0",
                    convert="unsigned",
                ),
                Port("saturated", "", "'1': a value did not fit its word"),
                Port(
                    "exhausted",
                    "",
                    "'1': the budget ended the search",
                ),
            ),
            output=True,
            record="decision",
            kind="decision_t",
        ),
        Group(
            "its cost, from valid until the next start; none if held or deadlock",
            (Port("cost", "COST_WIDTH - 1", f"J, unsigned, 1/{f.COST_UNIT}"),),
            output=True,
        ),
    ),
)


def _coefficient(name: str, comment: str) -> Port:
    return Port(f"c_{name}", "WORD_WIDTH - 1", comment, name)


#: Ports that both cores of the two-level drive have.
_MPTC_INPUTS = (
    Group("", _CLOCK),
    Group(
        "measurements and references, sampled with start",
        (
            Port("is_alpha", "15", "stator current, signed, current_max/32767"),
            Port("is_beta", "15", "signed, current_max/32767"),
            Port("psis_alpha", "15", "stator flux linkage, signed, psi_max/32767"),
            Port("psis_beta", "15", "signed, psi_max/32767"),
            Port("omega_r", "15", "electrical speed, signed, speed_max/32767"),
            Port("v_dc", "15", "dc-link voltage, unsigned, vdc/32768"),
            Port("torque_ref", "15", "torque reference, signed, torque_max/32767"),
            Port("psi_ref", "14", "flux reference, unsigned, psi_max/26979"),
            Port("u", "2", "number of the vector being applied, 0 to 7"),
        ),
        record="inputs",
        kind="mptc_inputs_t",
    ),
    Group(
        "parameters from a drive file, stable from start to valid; coefficients signed, 17 "
        "fractional bits",
        (
            _coefficient("current", "I/W: current in w"),
            _coefficient("flux", "-lambda*L_r*P/W: flux in w"),
            _coefficient("rotor", "w in T_s*dw/dt"),
            _coefficient("rotor_flux", "flux in T_s*dw/dt"),
            _coefficient("drop_current", "-T_s*R_s*I/P: current in T_s*dpsi_s/dt"),
            _coefficient("drop", "w in T_s*dpsi_s/dt"),
            _coefficient("drop_flux", "flux in T_s*dpsi_s/dt"),
            _coefficient("speed", "T_s*speed_max"),
            _coefficient("voltage_alpha", "2*T_s*2/3*v_dc in fluxes"),
            _coefficient("voltage_beta", "2*T_s*v_dc/sqrt(3) in fluxes"),
            _coefficient("torque", "torque_max in torque terms"),
            _coefficient("weight", "k_psi, not negative"),
        ),
        record="coefficients",
        kind="mptc_coefficients_t",
    ),
    Group("", (Port("method_mpfc", "", "'1': MPFC, '0': MPTC; sampled with start"),)),
)
_MPTC_COST = Group(
    "its cost, in the clock of valid alone; of one vector a period alone",
    (Port("cost", "COMPARED_WIDTH - 1", "as it is compared, signed"),),
    output=True,
)
_MPTC_DECISION = (
    Group(
        "decision, stable until the next valid",
        (
            Port("valid", "", "'1' for one clock: decision is new"),
            Port("busy", "", "'1': a decision is under way"),
            Port("u_next", "2", "number of the vector to apply next, 0 to 7"),
            Port("switches", "2", "its switch states a, b, c; '1': positive rail"),
            Port("saturated", "", "'1': a value did not fit its word, or v_dc is zero"),
            Port("clamped", "", "'1': MPFC cannot reach torque_ref"),
        ),
        output=True,
        record="decision",
        kind="mptc_decision_t",
    ),
)

MPTC = Shell(
    entity="mptc_core",
    inner="mptc_controller",
    folder="mptc",
    header="""\
Predictive torque control (MPTC) and predictive flux control (MPFC) of an induction machine on a
two-level inverter (Paper B): the core.

Give the measurements, the references and the vector that is being applied with a one-clock start.
valid comes with the vector to apply next. docs/specification.md says what is decided: the state is
taken to k+1 by Heun's method (eqs. 4 and 5), i_s0 is formed once (eq. 14), one stator flux and one
torque per vector (eqs. 13 and 15). The cost is that of eq. 11 with k_psi; for MPFC it is the square
of the distance from the reference vector of eqs. 18 to 21 (eq. 17). A tie goes to the lowest
number. u_0 or u_7 stands for zero voltage, whichever takes fewer commutations from u.

How: three mac_blocks follow a program (model/directmpc/mptc/program.py), where every product stands
with its clock. w = i_s - lambda*L_r*psi_s is a state in place of the current; i_s0 then is one
Euler step of w (model/directmpc/mptc/formats.py). After that the seven vectors pass, one a clock:
flux by two additions, its length by mptc_magnitude, torque by two additions, cost by the third
mac_block, comparison. MPFC needs neither arcsine nor division: multiplied by |w|**2 its reference
vector is made of products and one square root (mptc_root). The parts stand in mptc_sequencer,
mptc_datapath, mptc_vector_stream and mptc_flux_reference; mptc_controller connects them.

Formats: fractions of the drive's full scales, model/directmpc/mptc/formats.py; parameters as
directmpc.mptc.coefficients computes them from a drive file.
Latency: valid 39 clocks after start for MPTC, 78 for MPFC, always. One decision at a time; the next
start may come with valid.
Overflow: saturates and sets saturated; nothing wraps. clamped says that the torque reference was
beyond what the rotor flux allows (the arcsine's argument beyond 1).
Corners: with all costs equal the lowest number wins. Without rotor flux MPFC takes it to lie along
alpha, an angle of zero, so that a start from zero flux moves.
FLUX_CONTROL = false leaves MPFC out; the core then ignores method_mpfc.
mptc_family_core has MPTC1, MPTC2 and GTV, which apply two vectors a period, too.
Considered and rejected: rtl/alternatives.md.""",
    packages=("mptc_constants", "mptc_types"),
    generics=(("FLUX_CONTROL", "boolean", "true", "true: MPFC can be chosen at run time"),),
    groups=(*_MPTC_INPUTS, *_MPTC_DECISION, _MPTC_COST),
    fixed=(("FAMILY", "false"),),
    tied=(
        ("family_method", "FAMILY_NONE"),
        ("duty_rule", "RULE_DEADBEAT"),
        ("running", "NO_VOLTAGE"),
        ("chosen", "open"),
    ),
)

MPTC_FAMILY = Shell(
    entity="mptc_family_core",
    inner="mptc_controller",
    folder="mptc",
    header="""\
Predictive torque control with one and two vectors a period (MPTC, MPTC1, MPTC2, GTV) and
predictive flux control with one, two and three (MPFC, MPFC2, MPFC3, MPC2, SVM) of an induction
machine on a two-level inverter (Paper B): the core.

MPTC and MPFC are those of mptc_core, which explains them. family_method chooses one of the others
(docs/specification.md, section 3.6): next_u1 is applied for next_t1, next_u2 for next_t2, next_u3
for the rest; SVM means the seven segments of vector_sequencer. What is being applied is u1, u2, u3,
t1, t2; its mean voltage enters the prediction (eq. 5). u is for MPTC and MPFC and tells which zero
vector takes fewer commutations. With them next_u1 to next_u3 are u_next, next_t1 is the whole
period.

How: MPTC's program to its end. The torque is linear in the duty of a pair, so the duty is a
quotient, found two bits a clock, or the root of one, found bit by bit, by two mptc_duty
(mptc_pair_stream). With the rule best a second duty is the quotient of two lengths of the flux, and
both are tried. The pair's mean share then is an operand as that of the running sequence is
(mptc_shares), and its flux and its torque are products. Lengths and costs of pairs take the way
that single vectors take. The program is a table in block RAM. The flux methods take
MPFC's program to its reference. What is missing to it is divided by the way of a vector once
(mptc_coordinates); then all times are sums, and only distances are products (mptc_choices).

Formats: as mptc_core; times 1/4096 of the period, 4096 for all of it.
Latency: valid 39 clocks after start for MPTC, 78 for MPFC, 54 for MPTC1, 73 for MPTC2, 77 for GTV,
110 for MPFC2, MPFC3, MPC2 and SVM, always; with the rule best 64 for MPTC1, 79 for MPTC2. One
decision at a time; the next start may come with valid.
Overflow: saturates and sets saturated; nothing wraps. A duty is limited to 0 and 4095/4096.
Where t1 + t2 is above 4096, u3 counts for the whole period and saturated is set.
Considered and rejected: rtl/alternatives.md.""",
    packages=("mptc_constants", "mptc_types"),
    generics=(),
    groups=(
        *_MPTC_INPUTS,
        Group(
            "sampled with start as well",
            (
                Port("family_method", "2", "0: see method_mpfc; 1 to 7: MPTC1 to SVM"),
                Port("duty_rule", "1", "MPTC1, MPTC2: 0: deadbeat, 1: mean torque, 2 or 3: best"),
            ),
        ),
        Group(
            "",
            (
                *(
                    Port(name, "2", f"{which} vector being applied, 0 to 7")
                    for name, which in (("u1", "first"), ("u2", "second"), ("u3", "third"))
                ),
                *(
                    Port(name, "12", f"time of the {which}, 1/4096; t1 + t2 at most 4096")
                    for name, which in (("t1", "first"), ("t2", "second"))
                ),
            ),
            record="running",
            kind="mptc_sequence_t",
        ),
        *_MPTC_DECISION,
        Group(
            "",
            (
                *(
                    Port(f"next_{name}", "2", f"{which} vector to apply next, 0 to 7", name)
                    for name, which in (("u1", "first"), ("u2", "second"), ("u3", "third"))
                ),
                *(
                    Port(f"next_{name}", "12", f"time of the {which}, 1/4096 of the period", name)
                    for name, which in (("t1", "first"), ("t2", "second"))
                ),
            ),
            output=True,
            record="chosen",
            kind="mptc_sequence_t",
        ),
        _MPTC_COST,
    ),
    fixed=(("FLUX_CONTROL", "true"), ("FAMILY", "true")),
)

SHELLS: tuple[Shell, ...] = (MPDCC, MPTC, MPTC_FAMILY)


def _aligned(
    rows: list[tuple[str, ...]], comments: list[str], between: tuple[str, ...]
) -> list[str]:
    """Lines of a block of declarations, their parts and comments in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row, comment in zip(rows, comments, strict=True):
        code = "".join(
            f"{part:<{width}}{gap}"
            for part, width, gap in zip(row, widths, (*between, ""), strict=True)
        )
        lines.append(f"    {code} -- {comment}")
        if len(lines[-1]) > _LINE:
            raise ValueError(f"{len(lines[-1])} characters, {_LINE} are allowed: {lines[-1]}")
    return lines


def _blocks(shell: Shell) -> list[list[tuple[Group, Port]]]:
    """Ports below one comment, which stand in the same columns."""
    blocks: list[list[tuple[Group, Port]]] = []
    for group in shell.groups:
        if group.comment or not blocks:
            blocks.append([])
        blocks[-1] += [(group, port) for port in group.ports]
    return blocks


def _declarations(shell: Shell) -> list[str]:
    """Lines of the port list."""
    lines = []
    final = shell.groups[-1].ports[-1]
    for block in _blocks(shell):
        if block[0][0].comment:
            lines.append(f"    -- {block[0][0].comment}")
        rows = []
        for group, port in block:
            kind = f"std_logic_vector({port.width} downto 0)" if port.width else "std_logic"
            mode = "out  " if group.output else "in   "
            rows.append((port.name, mode, kind + ("" if port is final else ";")))
        lines += _aligned(rows, [port.comment for _, port in block], (" : ", " "))
    return lines


def _copied(group: Group, port: Port) -> tuple[str, str]:
    """Target and source of a port's copy."""
    field = port.field or port.name
    inside = f"{group.record}{'' if field.startswith('(') else '.'}{field}"
    if group.output:
        return port.name, f"std_logic_vector({inside})" if port.convert else inside
    return inside, f"{port.convert}({port.name})" if port.convert else port.name


def _associated(pairs: dict[str, str]) -> list[str]:
    """Lines of a map."""
    width, final = max(map(len, pairs)), list(pairs)[-1]
    return [
        f"      {name:<{width}} => {value}{',' if name != final else ''}"
        for name, value in pairs.items()
    ]


def text(shell: Shell) -> str:
    """The whole file of a shell."""
    converts = any(port.convert for group in shell.groups for port in group.ports)
    lines = [f"-- {line}".rstrip() for line in shell.header.splitlines()]
    lines += [
        "--",
        f"-- This flat shell around {shell.inner} is generated by `make generate`",
        "-- (scripts/generate/core_shells.py); do not edit.",
        "-- Licence: Apache-2.0",
        "",
        "library ieee;",
        "  use ieee.std_logic_1164.all;",
        *(["  use ieee.numeric_std.all;"] if converts else []),
        "",
        "library work;",
        *(f"  use work.{name}.all;" for name in shell.packages),
        "",
        f"entity {shell.entity} is",
    ]
    if shell.generics:
        rows = [
            (name, kind, default + ("" if name == shell.generics[-1][0] else ";"))
            for name, kind, default, _ in shell.generics
        ]
        comments = [comment for *_, comment in shell.generics]
        lines += ["  generic (", *_aligned(rows, comments, (" : ", " := ")), "  );"]
    lines += ["  port (", *_declarations(shell), "  );", f"end entity {shell.entity};", ""]
    lines += [f"architecture rtl of {shell.entity} is", ""]
    records = [group for group in shell.groups if group.record]
    kinds = {group.record: group.kind for group in records}
    width = max(map(len, kinds))
    lines += [f"  signal {name:<{width}} : {kind};" for name, kind in kinds.items()]
    lines += ["", "begin", ""]
    for group in records:
        pairs = [_copied(group, port) for port in group.ports]
        width = max(len(target) for target, _ in pairs)
        lines += [f"  {target:<{width}} <= {source};" for target, source in pairs]
        lines.append("")
    names = [
        name
        for group in shell.groups
        for name in ([group.record] if group.record else [port.name for port in group.ports])
    ]
    inner = {name: name for name in names} | dict(shell.tied)
    generics = {name: name for name, *_ in shell.generics} | dict(shell.fixed)
    lines += [f"  i_core : entity work.{shell.inner}", "    generic map ("]
    lines += [*_associated(generics), "    )", "    port map (", *_associated(inner)]
    lines += ["    );", "", "end architecture rtl;", ""]
    return "\n".join(lines)


def write() -> None:
    """Write every shell."""
    for shell in SHELLS:
        tools.write(shell.path, text(shell))
