"""Shipped drive files with the studies' bounds, without the keys that the studies recommend.

Tests that set these keys themselves, or that compare with the papers' rules, begin from here.
"""

from __future__ import annotations

from pathlib import Path

from scripts.generate.drive_template import RECOMMENDED
from scripts.hdl import states
from scripts.shared.tools import BUILD, ROOT, write


def plain_text(name: str) -> str:
    """The text of a shipped drive file with the studies' bounds and without what is recommended."""
    text = states.studied_text((ROOT / "drives" / f"{name}.toml").read_text(encoding="utf-8"))
    keys = {key for recommended in RECOMMENDED.values() for key in recommended}
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if line.split(" ", 1)[0] not in keys)


def plain_file(name: str) -> Path:
    """The same as a file; it is named as the shipped one is."""
    path = BUILD / "tests" / "plain" / f"{name}.toml"
    text = plain_text(name)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path, text)
    return path
