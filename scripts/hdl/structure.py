"""What an architecture is made of: its instances and processes, and the signals between them.

The reader knows the statements that the design uses: instances, processes, assignments, assertions
and `generate`. A signal counts as a whole, whatever part of it is read or driven. An assignment
outside of a process is wiring: what it reads reaches who reads what it drives.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from scripts.shared.tools import ToolError

#: Ends of a connection that are no block: the ports that are read, and those that are driven.
INPUTS, OUTPUTS = "(inputs)", "(outputs)"

_TOKEN = re.compile(
    r"\\[^\\\n]+\\|[a-z]\w*|\d[\w.#]*|\"(?:[^\"\n]|\"\")*\"|<=|=>|:=|/=|>=|\*\*|\S", re.I
)
_NAME = re.compile(r"[a-z]\w*|\\.*\\", re.I)
_LITERAL = re.compile(r"(?<![\w)])'.'")
_PORT = re.compile(r"^\s*([\w\s,]+?)\s*:\s*(inout|in|out)\b", re.I)


class StructureError(ToolError):
    """An architecture holds a statement that the reader does not know."""


@dataclass(frozen=True)
class Block:
    """An instance or a process."""

    label: str  #: Its own.
    entity: str  #: What is instantiated; empty for a process.
    #: The `generate` around it, "if X" or "for i in a to b", from outside to inside; mostly empty.
    condition: str
    #: Signals and ports of the architecture.
    reads: frozenset[str]
    drives: frozenset[str]


@dataclass(frozen=True)
class Structure:
    """An architecture."""

    entity: str  #: Whose it is.
    #: Ports in order.
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    blocks: tuple[Block, ...]  #: In order.
    #: Driven signal and the signals read, for each assignment outside of a process.
    wires: tuple[tuple[str, frozenset[str]], ...]
    clocks: frozenset[str]  #: Clocks, which every register reads.

    def origins(self, signal: str) -> frozenset[str]:
        """Who drives a signal, directly or through wiring."""
        found, seen, todo = set(), set(), [signal]
        while todo:
            name = todo.pop()
            if name in seen:
                continue
            seen.add(name)
            if name in self.inputs:
                found.add(INPUTS)
            found |= {block.label for block in self.blocks if name in block.drives}
            todo += sorted(one for driven, read in self.wires if driven == name for one in read)
        return frozenset(found)

    def connections(self) -> dict[tuple[str, str], frozenset[str]]:
        """What leads from where to where."""
        silent = self.clocks | {"rst"}
        found: dict[tuple[str, str], set[str]] = {}
        readers = [(block.label, block.reads) for block in self.blocks]
        for reader, names in [*readers, (OUTPUTS, frozenset(self.outputs))]:
            for name in names - silent:
                for origin in self.origins(name) - {reader}:
                    found.setdefault((origin, reader), set()).add(name)
        return {pair: frozenset(names) for pair, names in found.items()}


def interface(text: str, unit: str) -> dict[str, str]:
    """Direction of every port of an entity, or of a component."""
    code = re.sub(r"--[^\n]*", "", text)
    start = re.search(rf"\b(?:entity|component)\s+{re.escape(unit)}\s+is\b", code, re.I)
    if start is None:
        raise StructureError(f"{unit}: no entity and no component of that name")
    stop = re.search(r"\bend\b", code[start.end() :], re.I)
    body = code[start.end() : start.end() + stop.start()] if stop else code[start.end() :]
    clause = re.search(r"\bport\s*\(", body, re.I)
    found: dict[str, str] = {}
    for line in body[clause.end() :].split(";") if clause else []:
        row = _PORT.match(line)
        if row:
            found |= {name.strip().lower(): row[2].lower() for name in row[1].split(",")}
    return found


@dataclass
class _Reader:
    """Reads the statements of one architecture."""

    tokens: list[str]
    known: set[str]
    text: str
    interfaces: Mapping[str, Mapping[str, str]]
    at: int = 0
    blocks: list[Block] = field(default_factory=list)
    wires: list[tuple[str, frozenset[str]]] = field(default_factory=list)
    clocks: set[str] = field(default_factory=set)

    def peek(self, ahead: int = 0) -> str:
        """A token in small letters; empty behind the end."""
        place = self.at + ahead
        return self.tokens[place].lower() if place < len(self.tokens) else ""

    def upto(self, *ends: str) -> list[str]:
        """Tokens up to one of some, outside of parentheses; that one is passed."""
        start, depth = self.at, 0
        while self.at < len(self.tokens):
            token = self.peek()
            if depth == 0 and token in ends:
                self.at += 1
                return self.tokens[start : self.at - 1]
            depth += {"(": 1, ")": -1}.get(token, 0)
            self.at += 1
        raise StructureError(f"no {' or '.join(ends)} behind {' '.join(self.tokens[start:][:4])}")

    def ended(self, kind: str) -> list[str]:
        """Tokens up to `end kind`; the semicolon behind it is passed."""
        start = self.at
        while self.at < len(self.tokens):
            if self.peek() == "end" and self.peek(1) == kind:
                found = self.tokens[start : self.at]
                self.upto(";")
                return found
            self.at += 1
        raise StructureError(f"no end of the {kind}")

    # --- declarations

    def declarations(self) -> None:
        """Pass declarations and note the signals, up to `begin`, which is passed."""
        while self.at < len(self.tokens):
            token = self.peek()
            if token == "begin":
                self.at += 1
                return
            if token in ("function", "procedure"):
                head = self.at
                while self.peek() not in ("is", ";"):
                    self.at += 1 if self.peek() != "(" else self._closed()
                if self.peek() == "is" and self.at > head:
                    self.ended(token)
            elif token == "component":
                self.ended(token)
            elif token == "signal":
                self.at += 1
                self.known |= {n.lower() for n in self.upto(":") if n != ","}
                self.upto(";")
            elif token == "attribute":
                self.upto(";")
            else:
                self.at += 1
        raise StructureError("no begin behind the declarations")

    def _closed(self) -> int:
        """Number of tokens up to the parenthesis that closes the one here."""
        depth, ahead = 0, 0
        while True:
            depth += {"(": 1, ")": -1}.get(self.peek(ahead), 0)
            ahead += 1
            if depth == 0:
                return ahead

    # --- expressions

    def names(self, tokens: list[str]) -> Iterator[str]:
        """Signals that an expression names; fields, attributes and formals are none."""
        for place, token in enumerate(tokens):
            before = tokens[place - 1] if place else ""
            after = tokens[place + 1] if place + 1 < len(tokens) else ""
            name = token.lower()
            if name in self.known and before not in (".", "'") and after not in ("=>", "'"):
                yield name

    # --- statements

    def statements(self, conditions: tuple[str, ...], kind: str) -> None:
        """Read statements up to `end kind`."""
        while not (self.peek() == "end" and self.peek(1) == kind):
            if self.at >= len(self.tokens):
                raise StructureError(f"no end of the {kind}")
            label = ""
            if self.peek(1) == ":":
                label = self.peek()
                self.at += 2
            self._statement(label, conditions)
        self.upto(";")

    def _statement(self, label: str, conditions: tuple[str, ...]) -> None:
        token = self.peek()
        if token == "process":
            self.at += 1
            self._process(label, conditions)
        elif token == "assert":
            self.upto(";")
        elif token in ("if", "for"):
            head = " ".join(self.upto("generate"))
            if self.peek() in ("signal", "constant", "type", "subtype", "function", "begin"):
                self.declarations()
            self.statements((*conditions, _spaced(head)), "generate")
        elif token in ("entity", "component") or self.peek(1) in ("generic", "port"):
            self._instance(label, conditions)
        elif _NAME.fullmatch(token) and token in self.known:
            target = self.upto("<=")
            value = self.upto(";")
            reads = frozenset(self.names(value)) | frozenset(self.names(target[1:]))
            self.wires.append((target[0].lower(), reads))
        else:
            words = " ".join(self.tokens[self.at : self.at + 5])
            raise StructureError(f"a statement of an unknown kind: {words}")

    def _instance(self, label: str, conditions: tuple[str, ...]) -> None:
        body = self.upto(";")
        head = next(k for k, t in enumerate(body) if t.lower() in ("generic", "port"))
        entity = body[head - 1].lower()
        directions = self.interfaces.get(entity) or interface(self.text, entity)
        place = next(k for k, t in enumerate(body) if t.lower() == "port")
        reads, drives = set(), set()
        for formal, actual in _associations(body[place + 3 : -1]):
            names = list(self.names(actual))
            if formal not in directions:
                raise StructureError(f"{label}: {entity} has no port {formal}")
            if formal in ("clk", "clock") or (formal == "rst" and names == ["rst"]):
                self.clocks |= {n for n in names if n != "rst"}
            elif directions[formal] == "in":
                reads |= set(names)
            elif names:
                drives.add(names[0])
                reads |= set(names[1:])
        self._add(label, entity, conditions, reads, drives)

    def _process(self, label: str, conditions: tuple[str, ...]) -> None:
        body = self.ended("process")
        begin = next(k for k, t in enumerate(body) if t.lower() == "begin")
        reads, drives = set(), set()
        starts = {";", "begin", "then", "else", "loop", "=>"}
        code, place = body[begin:], 1
        while place < len(code):
            token = code[place].lower()
            target = token in self.known and code[place - 1].lower() in starts
            end = _behind(code, place) if target else place
            if target and end < len(code) and code[end] == "<=":
                drives.add(token)
                reads |= set(self.names(code[place + 1 : end]))
                place = end + 1
                continue
            if token in ("rising_edge", "falling_edge"):
                self.clocks.add(code[place + 2].lower())
            reads |= set(self.names(code[max(place - 1, 0) : place + 2][-3:])) & {token}
            place += 1
        self._add(label, "", conditions, reads, drives)

    def _add(
        self, label: str, entity: str, conditions: tuple[str, ...], reads: set[str],
        drives: set[str],
    ) -> None:  # fmt: skip
        if label in (block.label for block in self.blocks):
            label = f"{label} ({', '.join(conditions)})"  # the other arm of a generate
        shown = ", ".join(conditions)
        self.blocks.append(Block(label, entity, shown, frozenset(reads), frozenset(drives)))


def _spaced(text: str) -> str:
    """An expression as it would be written."""
    return re.sub(r"\( | \)", lambda found: found[0].strip(), text)


def _behind(code: list[str], place: int) -> int:
    """Where a name with its fields, indices and slices ends."""
    place += 1
    while place < len(code) and code[place] in (".", "("):
        if code[place] == ".":
            place += 2
            continue
        depth = 0
        while True:
            depth += {"(": 1, ")": -1}.get(code[place], 0)
            place += 1
            if depth == 0:
                break
    return place


#: What may stand around a formal: its port is inside.
_CONVERSIONS = ("signed", "unsigned", "std_logic_vector")


def _associations(tokens: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Formal and actual of each element of a port map."""
    element: list[str] = []
    depth = 0
    for token in [*tokens, ","]:
        if token == "," and depth == 0:
            arrow = element.index("=>")
            converted = arrow == 4 and element[0].lower() in _CONVERSIONS
            yield element[2 if converted else 0].lower(), element[arrow + 1 :]
            element = []
            continue
        depth += {"(": 1, ")": -1}.get(token, 0)
        element.append(token)


def structure(
    text: str, entity: str, interfaces: Mapping[str, Mapping[str, str]]
) -> Structure:  # fmt: skip
    """Read an architecture."""
    code = _LITERAL.sub('"0"', re.sub(r"--[^\n]*", "", text))
    start = re.search(rf"\barchitecture\s+\w+\s+of\s+{re.escape(entity)}\s+is\b", code, re.I)
    if start is None:
        raise StructureError(f"{entity}: no architecture")
    directions = interface(text, entity)
    reader = _Reader(_TOKEN.findall(code[start.end() :]), set(directions), text, interfaces)
    try:
        reader.declarations()
        reader.statements((), "architecture")
    except StructureError as error:
        raise StructureError(f"{entity}: {error}") from None
    return Structure(
        entity,
        tuple(name for name, way in directions.items() if way in ("in", "inout")),
        tuple(name for name, way in directions.items() if way in ("out", "inout")),
        tuple(reader.blocks),
        tuple(reader.wires),
        frozenset(reader.clocks),
    )
