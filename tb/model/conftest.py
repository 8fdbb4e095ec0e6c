"""What the tests of the model share."""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc.drive import Drive

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def drives_folder() -> Path:
    """The folder of the drive files that ship."""
    return ROOT / "drives"


@pytest.fixture(scope="session")
def drive(drives_folder: Path) -> Drive:
    """The 6 kV drive as it ships."""
    return load_mpdcc_drive(drives_folder / "anpc5l_6kv.toml")


@pytest.fixture(scope="session")
def verified_drive(drives_folder: Path) -> Drive:
    """The 3.3 kV drive as it ships."""
    return load_mpdcc_drive(drives_folder / "anpc5l_3kv3.toml")
