"""Run-downs of a motor as records: their motion, what was known on the shaft, and the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.driven_shaft import DrivenShaft
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.differentiation import differentiated
from bywire.identification.equation import (
    Equation,
    Motions,
    motions,
    steady_dynamics,
    window_residuals,
)
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem
from bywire.identification.unknown import Unknown, parameters_of
from bywire.plant import servo_motor

INERTIA = "motor_1.J_M"
NAMES = (INERTIA, "bearing.C_0", "bearing.T_nu", "motor_1.D_M")
_ADVICE = "let a fast shaft coast, as 'bywire run run-down' does"
_SCALE = 0.02  # of the torque that decelerates: what a known one has to be to set the scale


@dataclass(frozen=True)
class Reading:
    """How a record is read.

    Parameters
    ----------
    cutoff
        Low-pass before the angle is differentiated [Hz].
    slowest, margin, length
        Of the motion [rad/s], and times [s]; see
        :func:`bywire.identification.equation.windows`.
    """

    cutoff: float
    slowest: float
    margin: float
    length: float


@dataclass(frozen=True)
class RunDown:
    """One record: its motion, what was on the shaft, and the equation's error over it."""

    label: str
    par: WedgeParameters
    motion: Motions
    added: float
    torque: float
    equation: Equation

    def problem(self, unknowns: Sequence[Unknown]) -> Problem:
        """Return the averaged torque balance."""
        return window_residuals(self.equation, self.par, unknowns, self.motion)


def read_run(label: str, data: xr.Dataset, par: WedgeParameters, reading: Reading) -> RunDown:
    """Return a record's motion; what is added to the shaft counts as part of the dummy."""
    seen = data.rename({"q_1": "theta", "i_1": "i"})
    moved = differentiated(seen[["theta", "i"]], "theta", ("omega", "alpha"), reading.cutoff)
    moved["F"] = ("time", np.zeros(moved.sizes["time"]), {"units": "N"})
    motion = motions(moved, "omega", reading.slowest, reading.margin, reading.length)
    if len(motion.windows) < len(NAMES):
        raise ParameterError(
            f"record {label} keeps above {reading.slowest:g} rad/s for {len(motion.windows)} "
            f"windows of {1e3 * reading.length:g} ms: too few; {_ADVICE}"
        )
    added = float(data["J_added"].values[0])
    run_par = par.replace(
        {"rig.load": "dummy", "rig.J_dummy": par.rig.J_dummy + added, "motor_1.T_cog": 0.0}
    )
    K_T = servo_motor.torque_constant(par.motor_1)
    torque = K_T * float(np.mean(motion.means(moved["i"].values)))
    equation = Equation(DrivenShaft(), "omega", "alpha", reading.slowest)
    return RunDown(label, run_par, motion, added, torque, equation)


def fitted(runs: Sequence[RunDown], names: Sequence[str]) -> Estimate:
    """Fit the torque balances of all records for parameters of the motor and its bearings."""
    unknowns = parameters_of(runs[0].par, names)
    return steady_dynamics([run.problem(unknowns) for run in runs], unknowns, _ADVICE)


def _deceleration(run: RunDown) -> float:
    return float(np.mean(np.abs(run.motion.means(run.motion.data["alpha"].values))))


def scale_is_told(runs: Sequence[RunDown]) -> bool:
    """Return whether an inertia or a torque that is known weighs beside what is not.

    The current that the back-EMF drives through the loop is in proportion to the deceleration: it
    counts like inertia, and sets no scale worth the name.
    """
    J = [run.par.motor_1.J_M + run.par.rig.J_dummy for run in runs]
    if max(J) - min(J) > _SCALE * min(J):
        return True
    torque = [run.torque for run in runs]
    return max(torque) - min(torque) > _SCALE * J[0] * max(map(_deceleration, runs))


def by_source(runs: Sequence[RunDown]) -> dict[str, tuple[float, float]]:
    """Return the inertia and its deviation by the added inertia alone, by the current alone."""
    quiet = min(abs(run.torque) for run in runs)
    J = min(run.par.motor_1.J_M + run.par.rig.J_dummy for run in runs)
    small = _SCALE * J * max(map(_deceleration, runs))
    bare = [run for run in runs if abs(run.torque) <= quiet + small]
    first = min(run.added for run in runs)
    same = [run for run in runs if run.added == first]
    inertias = {}
    for name, chosen in (("added_inertia", bare), ("current", same)):
        if not 1 < len(chosen) < len(runs) or not scale_is_told(chosen):
            continue
        best = fitted(chosen, NAMES)
        if INERTIA in best.names:
            deviation = float(best.deviations[best.names.index(INERTIA)])
            inertias[name] = (best[INERTIA], deviation)
    return inertias


def left_over(runs: Sequence[RunDown], best: Estimate) -> list[Array]:
    """Return what is left over of every record [N m], by window."""
    values = best.parameters()
    unknowns = [u for u in best.unknowns if u.name in values]
    at = np.array([values[u.name] for u in unknowns])
    kept = {k.unknown.name: k.unknown.start for k in best.kept}
    return [
        replace(run, par=run.par.replace(kept)).problem(unknowns).evaluate(at)[0] for run in runs
    ]
