"""What the tests of the model share."""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mpdcc.drive import Drive
from scripts.hdl import states

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def drives_folder() -> Path:
    """The folder of the drive files that ship."""
    return ROOT / "drives"


@pytest.fixture(scope="session")
def drive() -> Drive:
    """The 6 kV drive with the papers' rules."""
    return states.shipped("anpc5l_6kv")


@pytest.fixture(scope="session")
def verified_drive() -> Drive:
    """The 3.3 kV drive with the papers' rules."""
    return states.shipped("anpc5l_3kv3")
