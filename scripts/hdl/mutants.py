"""Mutants of VHDL: small changes of one file, each of which a bench has to notice.

`mutants` reads the tokens of a file and finds the places where a change can mean something:

* **operator**: a relation, a logical or an arithmetic operator becomes another one, a `not` goes,
  one operand of a chain of `and`, `or` or `xor` goes;
* **constant**: a number, a bit or a truth value of an expression is another one;
* **condition**: a condition is always true, or never;
* **reset**: an assignment below `if (rst = '1')` goes;
* **dropped**: any other assignment of a process or a function goes, so a register keeps its value;
* **table**: the same as *constant*, within a table of constants;
* **wiring**: a port of an instance gets what the port behind it has.

Comments, texts, assertions, declarations of entities, types and ranges stay as they are. A mutant
need not compile. Its name is the line before and after the change, and a number where a file has
several such changes. So it does not depend on the number of the line.
"""

from __future__ import annotations

import itertools
import random
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

KINDS = ("operator", "constant", "condition", "reset", "dropped", "table", "wiring")

_TOKEN = re.compile(
    r"""(?P<comment>--[^\n]*)
    |(?P<bits>(?:\b[xXbBoO])?"[0-9A-Fa-f_]*")
    |(?P<text>"(?:[^"\n]|"")*")
    |(?P<number>\d[\d_]*(?:\#[0-9A-Fa-f_.]+\#|\.\d[\d_]*)?(?:[eE][+-]?\d+)?)
    |(?P<name>[A-Za-z]\w*|\\[^\\\n]+\\)
    |(?P<sign><=|>=|/=|:=|=>|\*\*|<>|\?=|.)""",
    re.X,
)
_CHARACTER = re.compile(r"'[^\n]'")
_RELATIONS = {
    "=": ("/=",),
    "/=": ("=",),
    "<": ("<=", ">="),
    "<=": ("<", ">"),
    ">": (">=", "<="),
    ">=": (">", "<"),
}
_LOGICAL = {"and": "or", "or": "and", "xor": "or", "nand": "nor", "nor": "nand", "xnor": "xor"}
_SWAPPED = {
    "shift_left": "shift_right", "shift_right": "shift_left",
    "minimum": "maximum", "maximum": "minimum", "true": "false", "false": "true",
}  # fmt: skip
#: Words that no operand ends with, so that a sign behind them has one operand, and a tick a bit.
_WORDS = {
    "and", "or", "xor", "nand", "nor", "xnor", "not", "when", "else", "if", "elsif", "return", "in",
    "is", "then", "to", "downto", "mod", "rem", "sll", "srl", "others", "abs", "range", "loop",
    "begin", "until", "while", "case", "select", "with", "process", "map", "generate", "of",
}  # fmt: skip
#: Clauses that are left as they are, up to their semicolon.
_LEFT = {
    "library", "use", "type", "subtype", "signal", "variable", "shared", "attribute", "file",
    "alias", "assert", "report", "wait", "context", "disconnect", "group",
}  # fmt: skip
_BODIES = {"process", "function", "procedure"}


@dataclass(frozen=True)
class Mutant:
    """One change of a file."""

    kind: str  #: One of ``KINDS``.
    #: Characters of the file that go, as a slice.
    start: int
    end: int
    new: str  #: What stands there instead.
    line: int  #: Number of the first changed line, from 1.
    #: The changed lines without comments, blanks squeezed.
    before: str
    after: str
    #: Its number among the changes of the file with the same `before` and `after`, from 1.
    place: int

    @property
    def name(self) -> tuple[str, str, int]:
        """What tells it from all others of its file."""
        return self.before, self.after, self.place

    def applied(self, source: str) -> str:
        """The file with the change."""
        return source[: self.start] + self.new + source[self.end :]


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    start: int
    end: int

    @property
    def low(self) -> str:
        return self.text.lower() if self.kind == "name" else self.text


@dataclass(frozen=True)
class _Change:
    kind: str
    start: int
    end: int
    new: str


def _tokens(source: str) -> Iterator[_Token]:
    """Tokens without comments and blanks."""
    place, last = 0, None
    while place < len(source):
        if source[place].isspace():
            place += 1
            continue
        operand = last is not None and (
            last.text in ")]" or (last.kind == "name" and last.low not in _WORDS)
        )
        # behind an operand a tick begins an attribute or a qualified expression
        found = None if operand else _CHARACTER.match(source, place)
        if found is not None:
            token = _Token("bit", found[0], place, found.end())
        else:
            match = _TOKEN.match(source, place)
            assert match is not None  # any character is a sign
            token = _Token(str(match.lastgroup), match[0], place, match.end())
        place = token.end
        if token.kind != "comment":
            last = token
            yield token


def code(source: str) -> str:
    """What a file says, without comments and blanks."""
    return "\n".join(token.text for token in _tokens(source))


# --- clauses --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Clause:
    """A piece of a file up to its semicolon, or up to the word that ends its head."""

    tokens: Sequence[_Token]
    sequential: bool
    below_reset: bool

    @property
    def first(self) -> str:
        return self.tokens[0].low


def _unlabelled(tokens: list[_Token]) -> list[_Token]:
    if len(tokens) > 2 and tokens[1].text == ":" and tokens[0].kind == "name":
        return tokens[2:]
    return tokens


def _ends(token: _Token, so_far: list[_Token]) -> bool:
    """Whether a token outside of all brackets ends the clause that it is the last one of."""
    first = _unlabelled(so_far)[0].low
    if token.text == ";":
        return True
    if first in _LEFT or first == "constant":
        return False
    if token.low in ("then", "loop", "generate", "begin", "is"):
        return True
    if token.low == "else":
        return len(so_far) == 1
    return token.text == "=>" and first == "when"


def _is_reset(condition: Sequence[_Token]) -> bool:
    return "".join(token.low for token in condition).strip("()") in ("rst='1'", "reset='1'")


def _clauses(tokens: Sequence[_Token]) -> Iterator[_Clause]:
    """Clauses outside of entities, components and records, with what they lie in."""
    held: list[_Token] = []
    depth, bodies, skipped = 0, 0, ""
    resets: list[bool] = []
    for token in tokens:
        held.append(token)
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        # a record's declaration has semicolons of its own
        if token.low == "record" and not skipped and held[0].low == "type":
            skipped, held = "record", []
            continue
        if depth or not _ends(token, held):
            continue
        labelled = held[0] is not _unlabelled(held)[0]
        clause, held = _unlabelled(held), []
        first = clause[0].low
        if skipped:
            if first == "end":
                skipped = ""
            continue
        if first in ("entity", "component") and not labelled and token.low == "is":
            skipped = first
            continue
        if first == "end":
            closed = clause[1].low
            if closed in _BODIES:
                bodies -= 1
            if closed == "if" and resets:
                resets.pop()
            continue
        if first in _BODIES | {"pure", "impure"} and token.text != ";":
            bodies += 1
        elif first == "if" and token.low == "then":
            resets.append(_is_reset(clause[1:-1]))
        elif first in ("elsif", "else") and resets:
            resets[-1] = False
        yield _Clause(clause, bodies > 0, any(resets))


# --- changes --------------------------------------------------------------------------------------


def _other_bits(text: str) -> str | None:
    """A string of bits or hexadecimal digits with its last bit turned."""
    prefix, _, digits = text[:-1].partition('"')
    base = {"x": 16, "o": 8}.get(prefix.lower(), 2)
    if not digits or (base == 2 and set(digits) - set("01_")):
        return None
    return f'{prefix}"{digits[:-1]}{int(digits[-1], 16) ^ 1:X}"'


def _constants(part: Sequence[_Token], kind: str) -> Iterator[_Change]:
    """Other numbers, bits and truth values."""
    for k, token in enumerate(part):
        around = {part[n].low for n in (k - 1, k + 1) if 0 <= n < len(part)}
        new: list[str] = []
        if token.kind == "number" and token.text.isdigit() and not around & {"downto", "to"}:
            value = int(token.text)
            new = [str(value + 1)] + ([str(value - 1)] if value else [])
        elif token.kind == "bit" and token.text in ("'0'", "'1'") and not around & {"=", "/="}:
            # beside a relation it is the same as the other relation
            new = ["'1'" if token.text == "'0'" else "'0'"]
        elif token.kind == "bits" and (other := _other_bits(token.text)):
            new = [other]
        elif token.low in ("true", "false"):
            new = [_SWAPPED[token.low]]
        for text in new:
            yield _Change(kind, token.start, token.end, text)


def _is_binary(part: Sequence[_Token], k: int) -> bool:
    """Whether the sign at a place has an operand before it."""
    before = part[k - 1] if k else None
    return before is not None and (
        before.text in ")]"
        or before.kind in ("number", "bit", "bits")
        or (before.kind == "name" and before.low not in _WORDS)
    )


def _operators(part: Sequence[_Token]) -> Iterator[_Change]:
    """Other operators; `part` has no sign of an assignment."""
    for k, token in enumerate(part):
        for text in _RELATIONS.get(token.text, ()):
            yield _Change("operator", token.start, token.end, text)
        if token.text in ("+", "-") and _is_binary(part, k):
            text = "-" if token.text == "+" else "+"
            yield _Change("operator", token.start, token.end, text)
        elif token.low in ("shift_left", "shift_right", "minimum", "maximum"):
            yield _Change("operator", token.start, token.end, _SWAPPED[token.low])
        elif token.low == "not" and k + 1 < len(part):
            yield _Change("operator", token.start, part[k + 1].start, "")
    yield from _chains(part)


def _groups(part: Sequence[_Token]) -> Iterator[list[_Token]]:
    """Expressions between brackets, commas and arrows, each with all that lies within it."""
    stack: list[tuple[list[_Token], list[_Token]]] = [
        ([], [])
    ]  # all in the brackets, behind a comma
    for token in part:
        if token.text == "(":
            stack.append(([], []))
            for own in stack[-2]:
                own.append(token)
        elif token.text == ")" and len(stack) > 1:
            whole, last = stack.pop()
            yield last
            for own in stack[-1]:
                own += [*whole, token]
        else:
            whole, last = stack[-1]
            whole.append(token)
            if token.text in (",", "=>") or token.low in ("when", "else"):
                yield last
                stack[-1] = (whole, [])
            else:
                last.append(token)
    yield stack[0][1]


def _chains(part: Sequence[_Token]) -> Iterator[_Change]:
    """Chains of one logical operator: all of them another one, or without one operand."""
    for group in _groups(part):
        depth, places = 0, []
        for k, token in enumerate(group):
            depth += {"(": 1, ")": -1}.get(token.text, 0)
            if depth == 0 and token.low in _LOGICAL:
                places.append(k)
        if not places or not places[0] > 0 or places[-1] + 1 >= len(group):
            continue
        old = group[places[0]].low
        if any(group[k].low != old for k in places):
            continue
        # VHDL wants brackets where they differ, so all of a chain change at once
        text, start = "", group[places[0]].start
        for k, after in itertools.pairwise([*places, None]):
            text += _LOGICAL[old]
            if after is not None:
                text += _between(group, k + 1, after)
        yield _Change("operator", start, group[places[-1]].end, text)
        yield _Change("operator", group[0].start, group[places[0] + 1].start, "")
        ends = [*(group[k].start for k in places[1:]), group[-1].end]
        for k, end in zip(places, ends, strict=True):
            last = max(token.end for token in group if token.end <= end)
            yield _Change("operator", group[k - 1].end, last, "")


def _between(group: Sequence[_Token], first: int, behind: int) -> str:
    """Tokens of a chain as text, with a blank on both sides."""
    return " " + " ".join(token.text for token in group[first:behind]) + " "


def _conditions(part: Sequence[_Token], values: Sequence[str]) -> Iterator[_Change]:
    """A condition that does not depend on anything; that of a clock's edge stays."""
    words = {token.low for token in part}
    if not part or words & {"rising_edge", "falling_edge", "event"} or words <= {"true", "false"}:
        return
    for value in values:
        yield _Change("condition", part[0].start, part[-1].end, f"({value})")


def _assigned(clause: _Clause) -> int | None:
    """Place of the sign of an assignment, None where a clause is none."""
    depth = 0
    for k, token in enumerate(clause.tokens):
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        if depth == 0 and token.text in ("<=", ":="):
            return k
    return None


def _choices(part: Sequence[_Token]) -> Iterator[_Change]:
    """Conditions of a conditional assignment."""
    depth, begin = 0, None
    for k, token in enumerate(part):
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        if depth:
            continue
        if token.low == "when":
            begin = k + 1
        elif token.low == "else" and begin is not None:
            yield from _conditions(part[begin:k], ("true", "false"))
            begin = None
    if begin is not None:
        yield from _conditions(part[begin:], ("true", "false"))


def _values(part: Sequence[_Token], kind: str = "constant") -> Iterator[_Change]:
    yield from _operators(part)
    yield from _constants(part, kind)


def _wiring(clause: _Clause) -> Iterator[_Change]:
    """Constants of a generic map; ports of a port map that get what the next one has."""
    depth, begin, kind = 0, 0, ""
    actuals: list[tuple[int, int]] = []
    tokens = clause.tokens
    for k, token in enumerate(tokens):
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        if token.low in ("generic", "port") and depth == 0:
            kind = token.low
        elif token.text == "=>" and depth == 1:
            begin = k + 1
        ends = (token.text == "," and depth == 1) or (token.text == ")" and depth == 0)
        if ends and begin and kind == "generic":
            yield from _values(tokens[begin:k])
        elif ends and begin and kind == "port":
            actuals.append((begin, k))
        begin = 0 if ends else begin
    for (first, end), (other, other_end) in itertools.pairwise(actuals):
        old = " ".join(token.text for token in tokens[first:end])
        new = " ".join(token.text for token in tokens[other:other_end])
        if new != old and "open" not in (new.lower(), old.lower()) and old.lower() != "clk":
            yield _Change("wiring", tokens[first].start, tokens[end - 1].end, new)


def _changes(clause: _Clause) -> Iterator[_Change]:
    """All changes of a clause."""
    tokens, first = clause.tokens, clause.first
    inner = tokens[1:-1]
    if first in _LEFT or first in ("package", "architecture", "begin", "null", "block", "for"):
        return
    if first in _BODIES or first in ("pure", "impure", "when", "else", "is", "configuration"):
        return
    if first == "constant":
        at = next((k for k, token in enumerate(tokens) if token.text == ":="), None)
        if at is not None:
            value = tokens[at + 1 : -1]
            entries = sum(token.kind in ("number", "bit", "bits") for token in value)
            yield from _values(value, "table" if entries > 3 else "constant")
    elif first in ("if", "elsif", "while"):
        yield from _values(inner)
        yield from _conditions(inner, ("false",) if first == "while" else ("true", "false"))
    elif first in ("exit", "next"):
        at = next((k for k, token in enumerate(tokens) if token.low == "when"), len(tokens))
        yield from _values(tokens[at + 1 : -1])
        yield from _conditions(tokens[at + 1 : -1], ("true", "false"))
    elif first == "return":
        yield from _values(inner)
    elif first in ("case", "with"):
        if first == "with" and (at := _assigned(clause)) is not None:
            yield from _constants(_without_choices(tokens[at + 1 : -1]), "table")
    elif any(token.low == "map" for token in tokens):
        yield from _wiring(clause)
    elif (at := _assigned(clause)) is not None:
        value = tokens[at + 1 : -1]
        yield from _values(value)
        yield from _choices(value)
        if clause.sequential:
            kind = "reset" if clause.below_reset else "dropped"
            yield _Change(kind, tokens[0].start, tokens[-1].end, "null;")
    elif tokens[-1].text == ";":
        yield from _values(tokens[1:-1])


def _without_choices(part: Sequence[_Token]) -> list[_Token]:
    """Values of a selected assignment, without what selects them."""
    kept, choice = [], False
    for token in part:
        choice = token.low == "when" or (choice and token.text != ",")
        if not choice:
            kept.append(token)
    return kept


# --- mutants --------------------------------------------------------------------------------------


def _plain(text: str) -> str:
    """Lines without comments, blanks squeezed."""
    return " ".join(re.sub(r"--[^\n]*", "", text).split())


def mutants(source: str) -> list[Mutant]:
    """All mutants of a file."""
    found: dict[tuple[int, int, str], _Change] = {}
    for clause in _clauses(list(_tokens(source))):
        for change in _changes(clause):
            found.setdefault((change.start, change.end, change.new), change)
    result, seen = [], Counter[tuple[str, str]]()
    for one in sorted(found.values(), key=lambda c: (c.start, c.end, c.new)):
        first = source.rfind("\n", 0, one.start) + 1
        last = source.find("\n", one.end)
        last = len(source) if last < 0 else last
        before = _plain(source[first:last])
        after = _plain(source[first : one.start] + one.new + source[one.end : last])
        seen[before, after] += 1
        line = source.count("\n", 0, one.start) + 1
        place = seen[before, after]
        result.append(Mutant(one.kind, one.start, one.end, one.new, line, before, after, place))
    return result


def shuffled(everything: Sequence[Mutant], seed: int) -> list[Mutant]:
    """All mutants in an order of chance, with the kinds in turn."""
    rng = random.Random(seed)
    groups = [[one for one in everything if one.kind == kind] for kind in KINDS]
    for group in groups:
        rng.shuffle(group)
    turns = itertools.zip_longest(*groups)
    return [one for turn in turns for one in turn if one is not None]
