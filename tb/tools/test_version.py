"""The version stands in one place, and everything that states it follows.

Checks: register maps, FuseSoC cores, CITATION.cff, package metadata, the changelog; that the issue
forms are whole.
Does not prove: that the version is the right one.
"""

from __future__ import annotations

import re
import tomllib

import pytest
import yaml

import directmpc
from scripts.shared.tools import ROOT

VERSION = directmpc.__version__


def test_the_version_is_everywhere_the_same() -> None:
    major, minor, patch = VERSION.split(".")
    rdl = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "registers").glob("*.rdl"))
    for name, value in (("MAJOR", major), ("MINOR", minor), ("PATCH", patch)):
        assert f"`define DIRECTMPC_VERSION_{name} {value}\n" in rdl
    cores = list((ROOT / "rtl").glob("*.core"))
    assert cores
    for core in cores:
        assert re.search(
            rf"^name: directmpc:cores:\w+:{re.escape(VERSION)}$", core.read_text(), re.M
        )
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == VERSION
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## \[{re.escape(VERSION)}\]", changes, re.M)


def test_it_is_written_once() -> None:
    with (ROOT / "pyproject.toml").open("rb") as stream:
        project = tomllib.load(stream)
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "directmpc.__version__"}


@pytest.mark.parametrize("name", ["error", "hardware", "wish"])
def test_issue_forms_are_whole(name: str) -> None:
    path = ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml"
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(form)
    fields = form["body"]
    assert len({field["id"] for field in fields}) == len(fields)
    for field in fields:
        assert field["type"] in ("input", "textarea")
        assert field["attributes"]["label"]
