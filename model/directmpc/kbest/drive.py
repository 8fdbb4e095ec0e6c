"""The drive of a K-best controller: keys, ranges and defaults of its file.

Keys and units: docs/specification.md, section 4.1.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from directmpc.drive_tables import Section, integer, number, refused
from directmpc.mpdcc.drive import SAMPLING_INTERVAL, PerUnitDrive


class KbestControl(Section):
    """Settings of the K-best controller: ts in s, bounds as half widths in pu.

    `lambda_u` is the cost of a turn-on. `beam` is K, the plans that live on from stage to stage.
    `short_stages` stages of one step come first, then `long_stages` of two; every other period has
    one short stage less and one long stage more. The bounds are soft: less `soft_margin` they are
    where the costs `weight_vn` and `weight_vph` of the square of an excess begin.
    `delay_compensation` and `capacitor_filter` are those of MPDCC.
    """

    #: There is no estimate of the leakage in front of it.
    leakage_estimate: ClassVar[bool] = False

    ts: Annotated[
        float, Field(strict=True, gt=0.0, allow_inf_nan=False, description=SAMPLING_INTERVAL)
    ]
    bound_vn: number(0.02, 0.5, "pu")
    bound_vph: number(0.02, 0.5, "pu")
    lambda_u: number(0.0001, 0.5, "pu^2")
    beam: integer(1, 16) = 8
    short_stages: integer(1, 8) = 4
    long_stages: integer(1, 16) = 8
    soft_margin: number(0.0, 0.02, "pu") = 0.005
    weight_vn: number(0.0, 1024.0, "") = 128.0
    weight_vph: number(0.0, 1024.0, "") = 32.0
    delay_compensation: Annotated[bool, Field(strict=True, description="true or false")] = False
    capacitor_filter: integer(0, 7) = 0


class KbestDrive(PerUnitDrive):
    """A K-best drive as its file describes it, per unit."""

    controller: Literal["kbest"]
    control: KbestControl

    @model_validator(mode="after")
    def _check_margin(self) -> Self:
        c = self.control
        least = min(c.bound_vn, c.bound_vph)
        if c.soft_margin >= least:
            raise refused(
                "control.soft_margin",
                f"got {c.soft_margin:g} pu; it must be below bound_vn and bound_vph, {least:g} pu",
            )
        return self

    @property
    def search(self) -> dict[str, int]:
        """What a core is built for.

        Returns
        -------
        dict of str to int
            ``beam`` and ``stages``: K and H.
        """
        c = self.control
        return {"beam": c.beam, "stages": c.short_stages + c.long_stages}

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Half widths on [i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c], shape (7,).

        Returns
        -------
        ndarray of float64, shape (7,)
            Per unit; infinite for the currents, which have none.
        """
        c = self.control
        return np.array([np.inf] * 3 + [c.bound_vn] + [c.bound_vph] * 3)
