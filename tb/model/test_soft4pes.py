"""The comparison with Soft4PES, without Soft4PES: the bench, its refusals, and the page.

Stimulus: six steps a period on the drive of the comparison, as if another simulation had made them.
Checks: a run that is the plant's is measured, one that is not is refused; MPDCC switches as often
as it is asked to; a folder that is no clone is refused in one line; the page has every run, and
MPDCC is better than PWM in each and worse than a direct controller in some.
Does not prove: the figures of Soft4PES, which has to be there for them.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.__main__ import main
from scripts.shared import tables
from scripts.shared.tools import ToolError
from scripts.studies import soft4pes

RATED = 0.85


class Drive:
    """The drive of the comparison, per unit, in the place of Soft4PES."""

    rated = RATED

    def system(self) -> SimpleNamespace:
        """A new instance."""
        rs, rr, xls, xlr, xm = 0.0108, 0.0091, 0.1493, 0.1104, 2.3489
        xs, xr = xls + xm, xlr + xm
        par = SimpleNamespace(Rs=rs, Rr=rr, Xls=xls, Xlr=xlr, Xm=xm, Xr=xr, D=xs * xr - xm**2)
        flux = 0.91
        current = np.array([flux / xm, RATED * xr / (xm * flux)])
        return SimpleNamespace(
            par=par, conv=SimpleNamespace(v_dc=1.93), wr=0.99, psiR_mag_ref=flux,
            x=np.array([*current, flux, 0.0]), calc_stator_current=lambda *_: current,
        )  # fmt: skip


@pytest.fixture(scope="module")
def bench() -> soft4pes.Bench:
    return soft4pes.Bench(Drive())


def test_switchings_are_measured_on_one_plant(bench: soft4pes.Bench) -> None:
    steps = round((soft4pes.SETTLE + soft4pes.PERIODS) * 0.02 / soft4pes.FINE)
    # six steps, one fundamental period of 50 Hz
    turn = np.arange(steps) * soft4pes.FINE * 50
    phase = (turn[:, None] - np.arange(3) / 3 - 0.16) % 1.0
    positions = np.select([phase < 5 / 12, phase < 0.5, phase < 11 / 12], [2, 1, 0], 1)
    states = bench.states(positions, bench.first)
    found = bench.of((positions, states))
    assert found == bench.figures(positions, states)
    assert found.fsw == pytest.approx(50, abs=1)
    assert 0.1 < found.thd < 1
    states[1000, 0] += 1e-3
    with pytest.raises(ToolError, match=r"the two plants differ by 0\.001 pu"):
        bench.of((positions, states))


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
def test_mpdcc_switches_as_often(bench: soft4pes.Bench, horizon: str) -> None:
    found = bench.as_often(horizon, 300)
    assert found.fsw == pytest.approx(300, rel=0.1)
    assert 0.03 < found.thd < 0.08
    assert bench.mpdcc(horizon, 0.3).thd > 2 * found.thd


def test_what_is_no_clone_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        main(["soft4pes", str(tmp_path)])
    (line,) = capsys.readouterr().err.splitlines()
    assert f"is no clone of Soft4PES whose commit {soft4pes.COMMIT} is checked out" in line


def test_the_page_has_every_run() -> None:
    page = soft4pes.PAGE.read_text(encoding="utf-8")
    table = tables.inside(page, soft4pes.BEGIN, soft4pes.END)
    rows = [row.strip("| ").split(" | ") for row in table.splitlines() if row.startswith("| ")][2:]
    runs = len(soft4pes.CARRIERS) * 2 + sum(len(weights) for weights in soft4pes.WEIGHTS.values())
    assert len(rows) == runs
    assert all(len(row) == len(soft4pes.HEAD) for row in rows)
    switched = [[int(row[column]) for column in (1, 4, 7)] for row in rows]
    assert switched == sorted(switched)
    assert all(0.85 < other / own < 1.15 for own, *others in switched for other in others)
    # in % of the current: Soft4PES, SE, SESE
    both = [(row[0], *(float(row[column].rstrip(" %")) for column in (2, 5, 8))) for row in rows]
    assert all(max(se, sese) < own for name, own, se, sese in both if name.startswith("FOC"))
    assert any(own < min(se, sese) for name, own, se, sese in both if name.startswith("direct"))
