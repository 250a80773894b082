"""Strokes of a screw that drives and is driven back: what is read of each, and left over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.typing import Array
from bywire.identification.equation import Motions
from bywire.identification.estimate import Estimate
from bywire.identification.method import Check
from bywire.identification.residuals import lack_of_fit
from bywire.plant import servo_motor


@dataclass(frozen=True)
class Stroke:
    """Means of one motion.

    ``side``: motor, 1 or 2; ``omega``: speed [rad/s]; ``F``: magnitude of the force [N];
    ``drives``: whether the screw drives the load, or is driven back by it; ``torque``: of the
    motor, along the motion [N m]; ``error``: what the fit leaves over of it [N m].
    """

    side: int
    omega: float
    F: float
    drives: bool
    torque: float
    error: float


def strokes(shaft: Motions, residuals: Array, par: WedgeParameters, side: int) -> list[Stroke]:
    """Return a shaft's motions with the residual torque of each."""
    K_T, read = servo_motor.torque_constant(par.motor_1), []
    motion = np.array([w.motion for w in shaft.windows])
    for number in np.unique(motion):
        rows_of = [w.rows for w in shaft.windows if w.motion == number]
        rows = shaft.data.isel(time=slice(rows_of[0].start, rows_of[-1].stop))
        omega, F = float(rows["omega"].mean()), float(rows["F"].mean())
        sign = 1.0 if omega > 0.0 else -1.0
        torque = sign * K_T * float(rows["i"].mean())
        error = sign * float(residuals[motion == number].mean())
        read.append(Stroke(side, omega, abs(F), F * omega < 0.0, torque, error))
    return read


def fits(strokes_read: list[Stroke], best: Estimate) -> Check:
    """Return whether a curve of its own for every shaft and direction would fit better."""
    F = np.array([s.F for s in strokes_read]) / max(s.F for s in strokes_read)
    kind = [(s.side, s.drives) for s in strokes_read]
    groups = [np.array([each == k for each in kind], dtype=float) for k in sorted(set(kind))]
    e = np.array([s.error for s in strokes_read])
    scatter = {
        k: np.sqrt(np.mean([s.error**2 for s in strokes_read if s.side == k])) for k in (1, 2)
    }
    return lack_of_fit(
        "torque_left_over",
        e,
        np.array([1.0 / scatter[s.side] for s in strokes_read]),
        np.column_stack([g * F**power for g in groups for power in (0, 1, 2)]),
        len(best.values),
        "whether torque over force curves or shifts in a way that the laws do not have",
    )
