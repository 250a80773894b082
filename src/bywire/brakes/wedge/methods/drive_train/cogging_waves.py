"""Cogging of two motors that squeeze a force between their screws, in the current of both."""

from __future__ import annotations

import numpy as np

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.typing import Array
from bywire.identification.unknown import Unknown
from bywire.plant import servo_motor

_WAVES = {
    "cos": "cogging of known order over the motors' angle against each other, cosine",
    "sin": "the same, sine",
    "cos_drift": "what a drift of both motors the same way adds, cosine",
    "sin_drift": "the same, sine",
}


def waves(q_1: Array, q_2: Array, order: float) -> Array:
    r"""Return the waves that cogging makes in the current that squeezes, shape (n, 4).

    .. math::
        \{\cos\psi, \sin\psi\} \times \{\cos\delta, \sin\delta\}, \qquad
        \psi = N \frac{q_1 - q_2}{2}, \quad \delta = N \frac{q_1 + q_2}{2}

    with :math:`\delta` less its mean: every :math:`a \cos(N q_1 + \varphi_1) + b \cos(N q_2 +
    \varphi_2)` is a sum of them. The motors turn against each other, and :math:`\delta` is only by
    how much cogging itself moves both the same way; its waves vanish with it.

    Where one motor stands, its cogging is no wave, but part of the offset: what is returned then
    are the waves of the other, and zeros.

    ``q_1``, ``q_2``: angles [rad], shape (n,); ``order``: periods per revolution, N.
    """
    moving = [q for q in (q_1, q_2) if order * np.ptp(q) > np.pi]
    if len(moving) == 1:
        none = np.zeros_like(q_1)
        return np.column_stack((np.cos(order * moving[0]), np.sin(order * moving[0]), none, none))
    psi, both = 0.5 * order * (q_1 - q_2), 0.5 * order * (q_1 + q_2)
    delta = both - both.mean()
    wave = np.column_stack((np.cos(psi), np.sin(psi)))
    return np.hstack((np.cos(delta)[:, None] * wave, np.sin(delta)[:, None] * wave))


def unknowns(par: WedgeParameters, stage: str) -> tuple[Unknown, ...]:
    """Return the waves' amplitudes in a stage, in terms of the current."""
    K = servo_motor.torque_constant(par.motor_1)
    size = max(par.motor_1.T_cog, par.motor_2.T_cog, 1e-4) / K
    return tuple(
        Unknown(name, 0.0, scale=10.0 * size, unit=unit)
        for name, (unit, _) in meanings(stage).items()
    )


def meanings(stage: str) -> dict[str, tuple[str, str]]:
    """Return SI unit and meaning of the unknowns of a stage, by name."""
    return {f"cogging.{stage}.{name}": ("A", text) for name, text in _WAVES.items()}
