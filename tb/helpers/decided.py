"""What a converted netlist has decided rightly, so that the same is not asked of it twice.

A simulation of a netlist is a function of its text, its inputs and the simulator. `Decided` keeps
a digest of these and of the wanted answers, by name, in a file beside the test. A test that finds
its digest there is done; with any other it simulates. The tests themselves write digests, with
``pytest --note-decided``, in one process.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tomli_w

from scripts.shared import tools

TITLE = """\
# Netlist -> digest of its text, its inputs, the wanted answers and the simulator, as it passed.
# Written by pytest --note-decided; see tb/helpers/decided.py.

"""


def digest(simulation: str, *arrays: np.ndarray, compared: Sequence[str], seed: int) -> str:
    """Sixteen digits of a comparison.

    That is a simulation, as `netlist_check.key` names it, its inputs and answers, the outputs that
    are ``compared``, and the ``seed`` of all that is random in it.
    """
    numbers = [np.ascontiguousarray(a, dtype=np.int64).tobytes() for a in arrays]
    return tools.digest(simulation, *numbers, *compared, str(seed))[:16]


class Decided:
    """Digests of netlists that decided rightly."""

    def __init__(self, path: Path, note: bool = False) -> None:
        self.path = path
        self.note = note

    def digests(self) -> dict[str, str]:
        """Name -> digest."""
        if not self.path.exists():
            return {}
        return tomllib.loads(self.path.read_text(encoding="utf-8"))

    def has(self, name: str, found: str) -> bool:
        """Whether the netlist passed with just this."""
        return not self.note and self.digests().get(name) == found

    def passed(self, name: str, found: str) -> None:
        """Keep a digest, where that is asked for."""
        if self.note:
            known = dict(sorted((self.digests() | {name: found}).items()))
            tools.write(self.path, TITLE + tomli_w.dumps(known))
