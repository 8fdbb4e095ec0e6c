"""The speed controller of every closed loop."""

from __future__ import annotations

from directmpc.compiled import njit


@njit
def speed_pi(proportional, rate, weight, ts, total, wanted, speed, limit):
    """One step of a PI controller whose integral stands still while the torque is limited.

    Parameters
    ----------
    proportional, rate : float
        Gains: torque per speed, torque per speed and second.
    weight : float
        Of the reference in the proportional part; below 1 a step overshoots less.
    ts : float
        Control period, s.
    total : float
        Integral so far.
    wanted, speed : float
        Speed reference and speed.
    limit : float
        Largest torque.

    Returns
    -------
    torque : float
        From -limit to limit.
    total : float
        Integral from now on.
    """
    direct = proportional * (weight * wanted - speed)
    if abs(direct + total) < limit:
        total += rate * (wanted - speed) * ts
    return min(max(direct + total, -limit), limit), total
