"""A public name of the library without its sections turns `make lint` red; all else has a line.

Stimulus: a module with all its sections that the package exports, and copies of it with one fault
each, under the rules of `pyproject.toml`.
Does not prove: that what a section says is right.
"""

from __future__ import annotations

import contextlib
import io
import shutil
from pathlib import Path

import pytest

from scripts import __main__ as program
from scripts.measure import checks
from scripts.shared.tools import ROOT

WHOLE = '''"""A module."""


def torque(flux, current):
    """Torque of a machine.

    Parameters
    ----------
    flux : complex
        Wb.
    current : complex
        A.

    Returns
    -------
    float
        N*m.

    Raises
    ------
    ValueError
        If the flux is zero.
    """
    if not flux:
        raise ValueError("no flux")
    return (flux.conjugate() * current).imag


def steps(count):
    """Steps of a run.

    Parameters
    ----------
    count : int
        How many.

    Yields
    ------
    int
        Number of the step.
    """
    yield from range(count)
    yield count


class Machine:
    """A machine."""

    @property
    def poles(self):
        """Poles.

        Returns
        -------
        int
            Twice the pole pairs.
        """
        return 4


def _private(anything):
    return anything
'''

RETURNS = "\n    Returns\n    -------\n    float\n        N*m.\n"
RAISES = "\n    Raises\n    ------\n    ValueError\n        If the flux is zero.\n"

#: What is taken out, what takes its place, and numpydoc's word for it.
FAULTS = {
    "no parameters": (
        "    Parameters\n    ----------\n    count : int\n        How many.\n\n",
        "",
        "PR01 Parameters {'count'} not documented",
    ),
    "one parameter missing": (
        "    current : complex\n        A.\n",
        "",
        "PR01 Parameters {'current'} not documented",
    ),
    "a parameter that is not there": ("    count : int", "    number : int", "PR02 Unknown"),
    "another order": ("torque(flux, current)", "torque(current, flux)", "PR03 Wrong parameters"),
    "a parameter without type": ("    count : int", "    count", "PR04 Parameter"),
    "a parameter without description": ("        How many.\n", "", "PR07 Parameter"),
    "no returns": (
        "\n        Returns\n        -------\n        int\n            Twice the pole pairs.\n",
        "",
        "RT01 No Returns section found",
    ),
    "a result without description": ("        N*m.\n", "", "RT03 Return value has no description"),
    "no yields": (
        "\n    Yields\n    ------\n    int\n        Number of the step.\n",
        "",
        "YD01 No Yields section found",
    ),
    "sections in another order": (
        RETURNS + RAISES,
        RAISES + RETURNS,
        "GL07 Sections are in the wrong",
    ),
    "a public function without docstring": ("def _private", "def public", "GL08"),
}


def verdict(
    folder: Path, modules: dict[str, str], exported: str = "Machine, public, steps, torque"
) -> int:
    """Exit code of the step for these modules of the library in a folder."""
    library = folder / "model" / "directmpc"
    library.mkdir(parents=True)
    for name, text in modules.items():
        (library / f"{name}.py").write_text(text, encoding="utf-8")
    lines = [f"from directmpc.{name} import {exported}\n" for name in modules]
    (library / "__init__.py").write_text("".join(lines), encoding="utf-8")
    shutil.copy(ROOT / "pyproject.toml", folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checks, "ROOT", folder)
        return program.main(["lint", "numpydoc"])


def module_of(fault: str) -> str:
    """Name of the module with a fault."""
    return fault.replace(" ", "_")


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> list[str]:
    """Lines of one run over a whole module and one for each fault."""
    modules = {"whole": WHOLE}
    for fault, (old, new, _) in FAULTS.items():
        assert WHOLE.count(old) == 1, fault
        modules[module_of(fault)] = WHOLE.replace(old, new)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert verdict(tmp_path_factory.mktemp("faults"), modules) == 1
    return out.getvalue().splitlines()


def test_whole_docstrings_pass(tmp_path, capsys) -> None:
    assert verdict(tmp_path, {"whole": WHOLE}) == 0
    assert capsys.readouterr().out.startswith("ok    docstrings (numpydoc)")


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_turns_the_step_red(shown: list[str], fault: str) -> None:
    assert shown[0].startswith("FAIL  docstrings (numpydoc)")
    lines = [line for line in shown if f"model/directmpc/{module_of(fault)}.py:" in line]
    assert any(FAULTS[fault][2] in line for line in lines)


def test_faults_alone_are_named(shown: list[str]) -> None:
    assert not [line for line in shown if "whole.py" in line]


def test_tools_need_a_line_alone(tmp_path) -> None:
    old, new, _ = FAULTS["no returns"]
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "tool.py").write_text(WHOLE.replace(old, new), encoding="utf-8")
    assert verdict(tmp_path, {"whole": WHOLE}) == 0


def test_what_nobody_imports_needs_no_sections(tmp_path) -> None:
    old, new, _ = FAULTS["no parameters"]
    text = WHOLE.replace(old, new).replace(
        "    Yields\n    ------\n    int\n        Number of the step.\n", ""
    )
    assert verdict(tmp_path, {"whole": text}, "Machine, torque") == 0


def test_what_nobody_imports_has_no_sections(tmp_path, capsys) -> None:
    assert verdict(tmp_path, {"whole": WHOLE}, "Machine, torque") == 1
    assert "whole.py:29: 'steps' is not public" in capsys.readouterr().out


def test_a_page_makes_a_name_public(tmp_path, capsys) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "page.md").write_text("`directmpc.whole.steps(count)`", encoding="utf-8")
    old, new, word = FAULTS["no parameters"]
    assert verdict(tmp_path, {"whole": WHOLE.replace(old, new)}, "Machine, torque") == 1
    assert word in capsys.readouterr().out


def test_library_passes() -> None:
    assert checks.python_docstrings() == []
