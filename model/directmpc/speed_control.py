"""The speed controller of every closed loop."""

from __future__ import annotations

from directmpc.compiled import njit


@njit
def speed_pi(proportional, rate, weight, ts, total, wanted, speed, limit):
    """One step of a PI controller, its integral held while limited: torque, and the integral.

    `weight` is that of the reference in the proportional part; below 1 a step overshoots less.
    `rate` is torque per speed and second, `ts` in s.
    """
    direct = proportional * (weight * wanted - speed)
    if abs(direct + total) < limit:
        total += rate * (wanted - speed) * ts
    return min(max(direct + total, -limit), limit), total
