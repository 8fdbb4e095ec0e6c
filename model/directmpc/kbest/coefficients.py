"""Register values of a K-best drive: the load's matrices and the settings as words of the core."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.kbest import formats as f
from directmpc.kbest.drive import KbestDrive
from directmpc.loads.load import discretise
from directmpc.mpdcc.drive import only_default
from directmpc.mpdcc.formats import CURRENT, LINK_VOLTAGE, SPEED

_ROOT = math.sqrt(3.0)

#: What has to change where a coefficient does not fit.
_KEYS = {
    "angle": "control.ts", "decay_1": "machine", "decay_2": "machine", "flux_0": "machine",
    "flux_2": "machine", "flux_u": "machine", "flux_w": "machine", "forced_1": "machine",
    "forced_2": "machine", "level_1": "machine", "level_2": "machine", "neutral": "inverter.xdc",
    "capacitor": "inverter.xph",
}  # fmt: skip


@dataclass(frozen=True)
class Registers:
    """Register values of a drive."""

    # Words of `formats.COEFFICIENTS` and `formats.SETTINGS`, by name and in their order.
    values: dict[str, int]
    # beam, stages: K and H: generics of the core.
    beam: int
    stages: int

    def ports(self) -> dict[str, int]:
        """The words by the names of the ports and registers."""
        return {f"c_{n}" if n in f.COEFFICIENTS else n: word for n, word in self.values.items()}

    def array(self) -> NDArray[np.int64]:
        """The words in the order of the ports, then beam and stages."""
        return np.array([*self.values.values(), self.beam, self.stages], dtype=np.int64)


#: What the native libraries are built for.
BUILT = {"beam": 8, "stages": 12}


def only_built(drive: KbestDrive) -> None:
    """Refuse a drive of another converter or search than `BUILT`: ValueError with the key."""
    only_default(drive)
    if drive.search != BUILT:
        beam, stages = drive.search.values()
        raise ValueError(
            f"control.beam: got {beam} with {stages} stages; the native library has "
            f"{BUILT['beam']} with {BUILT['stages']}, and the engines ideal and model have any"
        )


def registers(drive: KbestDrive) -> Registers:
    """Turn a drive into the words of the core; ValueError names the key that does not fit."""
    only_default(drive)
    c, inverter, ts = drive.control, drive.inverter, drive.ts_pu
    load = drive.machine.matrices
    # what depends on the speed but little is taken at standstill; a12 is exact at 0 and 1 pu
    one, two = (discretise(load, 0.0, steps * ts) for steps in (1, 2))
    a12, turning = one[1], discretise(load, 1.0, ts)[1]
    one_word = 2.0**f.FRACTION
    speed = SPEED.scale * 2.0**f.SPEED_SHIFT
    flux = f.VECTOR_SCALE / f.FLUX_SCALE * one_word
    fast = flux * one_word / speed
    forced = f.ERROR_SCALE / 3.0
    level = forced / (4.0 * LINK_VOLTAGE.scale) * one_word
    real = {
        "angle": ts * _ROOT / speed * one_word * one_word,
        "decay_1": (1.0 - one[0].real) * one_word,
        "decay_2": (1.0 - two[0].real) * one_word,
        "flux_0": a12.real * flux,
        "flux_2": (turning.real - a12.real) * flux * (one_word / speed) ** 2,
        "flux_u": turning.imag * _ROOT * fast,
        "flux_w": turning.imag / _ROOT * fast,
        "forced_1": one[4].real * forced / f.VOLTAGE_SCALE * 2.0**f.FORCED_FRACTION,
        "forced_2": two[4].real * forced / f.VOLTAGE_SCALE * 2.0**f.FORCED_FRACTION,
        "level_1": one[4].real * level,
        "level_2": two[4].real * level,
        "neutral": ts / (2.0 * inverter.xdc) * _PER_CURRENT,
        "capacitor": ts / inverter.xph * _PER_CURRENT,
    }
    most = 2 ** (f.FACTOR_WIDTH - 1) - 1
    values = {}
    for name in f.COEFFICIENTS:
        values[name] = round(real[name])
        if abs(values[name]) > most:
            raise ValueError(
                f"{_KEYS[name]}: the core's coefficient {name} would be {values[name]}; it holds "
                f"-{most} to {most}, a shorter control.ts or larger inductances and capacitors are "
                "needed"
            )
    values |= {
        "effort": round(c.lambda_u * f.COST_SCALE),
        "bound_neutral": round((c.bound_vn - c.soft_margin) * f.VOLTAGE_SCALE),
        "bound_phase": round((c.bound_vph - c.soft_margin) * f.VOLTAGE_SCALE),
        "weight_neutral": _exponent("weight_vn", c.weight_vn),
        "weight_phase": _exponent("weight_vph", c.weight_vph),
        "short_stages": c.short_stages,
        "compensate": int(c.delay_compensation),
    }
    return Registers(values, **drive.search)


_PER_CURRENT = 2.0 * f.VOLTAGE_SCALE / f.VECTOR_SCALE * 2.0**f.FRACTION
"""Words of a charge's coefficient, of half a current, per unit of voltage and current."""

assert CURRENT.scale * 2**f.VECTOR_SHIFT == f.VECTOR_SCALE


def _exponent(key: str, weight: float) -> int:
    """Exponent of a weight, which has to be a power of two."""
    exponent = round(math.log2(weight)) if weight > 0.0 else -1
    if exponent not in f.WEIGHT_EXPONENTS or 2.0**exponent != weight:
        raise ValueError(
            f"control.{key}: got {weight:g}; the core needs a power of two from 1 to "
            f"{2 ** f.WEIGHT_EXPONENTS[-1]}"
        )
    return exponent
