"""`make fidelity`: how close the bit-true controllers come to the ideal one, and why no closer."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from directmpc.host.console import OneParagraphParser, report_error
from scripts.hdl.simulator import SimulationError
from scripts.publish import report
from scripts.shared.tools import ToolError
from scripts.studies.fidelity import study
from scripts.studies.fidelity.decisions import FidelityError


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and write; 0 when all is written, 2 when a figure could not be had."""
    parser = OneParagraphParser(prog="fidelity", description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time")
    given = parser.parse_args(arguments)
    try:
        study.write(study.collect(given.jobs))
        report.write_fidelity()
    except (
        FidelityError, SimulationError, ValueError, ToolError, OSError,
    ) as error:  # fmt: skip
        report_error("fidelity", error)
        return 2
    except KeyboardInterrupt:
        print("fidelity: interrupted; what was measured is kept", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
