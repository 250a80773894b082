"""Inertia and friction from motor run-downs (Roberts 2003, sections "Motor", "Bearings").

A run-down alone determines only the ratios of friction and damping to inertia: if all of them are
twice as large, the shaft stops in the same way. An added inertia or a known current sets the scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from bywire.brakes.wedge.case import turned
from bywire.brakes.wedge.experiments import run_down
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import DrivenShaft
from bywire.core.errors import ParameterError, counted
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.data.labeled import at_own_places, over
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
from bywire.identification.measured import joined, split
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.residuals import lack_of_fit
from bywire.identification.trust import Sensor, sensed
from bywire.identification.unknown import Unknown, parameters_of
from bywire.plant import servo_motor
from bywire.plant.axial_bearing import AngularSpeed

if TYPE_CHECKING:
    import xarray as xr

_INERTIA = "motor_1.J_M"
_NAMES = (_INERTIA, "bearing.C_0", "bearing.T_nu", "motor_1.D_M")
_ADVICE = "Let a fast shaft coast, as 'bywire run run-down' does"
_SCALE = 0.02  # minimum known torque that sets the scale, relative to the decelerating torque


@dataclass(frozen=True)
class RunDown:
    """Motion, shaft load and equation of motion of one record."""

    label: str
    par: WedgeParameters
    motion: Motions
    added: float
    torque: float
    equation: Equation

    def problem(self, unknowns: Sequence[Unknown]) -> Problem:
        """Return the averaged torque balance."""
        return window_residuals(self.equation, self.par, unknowns, self.motion)


def _read_run(label: str, data: xr.Dataset, par: WedgeParameters, options: Options) -> RunDown:
    """Return a record's motion. An inertia added to the shaft is treated as part of the dummy."""
    seen = data.rename({"q_1": "theta", "i_1": "i"})
    moved = differentiated(seen[["theta", "i"]], "theta", ("omega", "alpha"), options.cutoff)
    moved["F"] = ("time", np.zeros(moved.sizes["time"]), {"units": "N"})
    motion = motions(moved, "omega", options.slowest, options.margin, options.window)
    if len(motion.windows) < len(_NAMES):
        raise ParameterError(
            f"record {label} has {counted(len(motion.windows), 'window')} of "
            f"{1e3 * options.window:g} ms above {options.slowest:g} rad/s, but the fit needs >= "
            f"{len(_NAMES)}. {_ADVICE}",
            name=f"record {label}",
            value=str(len(motion.windows)),
            valid=f">= {len(_NAMES)}",
        )
    added = float(data["J_added"].values[0])
    run_par = par.replace(
        {"rig.load": "dummy", "rig.J_dummy": par.rig.J_dummy + added, "motor_1.T_cog": 0.0}
    )
    K_T = servo_motor.torque_constant(par.motor_1)
    torque = K_T * float(np.mean(motion.means(moved["i"].values)))
    equation = Equation(DrivenShaft(), "omega", "alpha", options.slowest)
    return RunDown(label, run_par, motion, added, torque, equation)


def _fitted(runs: Sequence[RunDown], names: Sequence[str]) -> Estimate:
    """Fit motor and bearing parameters to the torque balances of all records."""
    unknowns = parameters_of(runs[0].par, names)
    return steady_dynamics([run.problem(unknowns) for run in runs], unknowns, _ADVICE)


def _deceleration(run: RunDown) -> float:
    return float(np.mean(np.abs(run.motion.means(run.motion.data["alpha"].values))))


def _has_scale(runs: Sequence[RunDown]) -> bool:
    """Return whether a known inertia or torque is large enough to set the scale.

    The current that the back-EMF drives through the loop is proportional to the deceleration. It
    acts like inertia and cannot set a useful scale.
    """
    J = [run.par.motor_1.J_M + run.par.rig.J_dummy for run in runs]
    if max(J) - min(J) > _SCALE * min(J):
        return True
    torque = [run.torque for run in runs]
    return max(torque) - min(torque) > _SCALE * J[0] * max(map(_deceleration, runs))


def _by_source(runs: Sequence[RunDown]) -> dict[str, tuple[float, float]]:
    """Return inertia and standard deviation from the added inertia and from the current alone."""
    quiet = min(abs(run.torque) for run in runs)
    J = min(run.par.motor_1.J_M + run.par.rig.J_dummy for run in runs)
    small = _SCALE * J * max(map(_deceleration, runs))
    bare = [run for run in runs if abs(run.torque) <= quiet + small]
    first = min(run.added for run in runs)
    same = [run for run in runs if run.added == first]
    inertias = {}
    for name, chosen in (("added_inertia", bare), ("current", same)):
        if not 1 < len(chosen) < len(runs) or not _has_scale(chosen):
            continue
        best = _fitted(chosen, _NAMES)
        if _INERTIA in best.names:
            deviation = float(best.deviations[best.names.index(_INERTIA)])
            inertias[name] = (best[_INERTIA], deviation)
    return inertias


def _residuals_of(runs: Sequence[RunDown], best: Estimate) -> list[Array]:
    """Return the residual torques of each record [N m], one per window."""
    values = best.parameters()
    unknowns = [u for u in best.unknowns if u.name in values]
    at = np.array([values[u.name] for u in unknowns])
    fixed = {k.unknown.name: k.unknown.start for k in best.kept}
    return [
        replace(run, par=run.par.replace(fixed)).problem(unknowns).evaluate(at)[0] for run in runs
    ]


_RATIOS = {"bearing.C_0": "rad/s**2", "bearing.T_nu": "rad/s**2", "motor_1.D_M": "1/s"}
_AGREE = 3.0  # standard deviations


class Options(ParameterSet):
    """Part of a run-down that counts, filter, and the synthetic noise."""

    slowest: AngularSpeed
    """minimum speed, below which cogging and the Stribeck effect dominate"""
    margin: Duration
    """time to omit at the start and end of each coasting phase"""
    window: Duration
    """averaging time for the torque balance"""
    cutoff: Frequency
    """cutoff frequency of the low-pass filter for the angle before differentiation"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """current noise in synthetic measurements"""
    sigma_q: Annotated[float, Unit("rad", 1e-4), Field(ge=0)]
    """angle noise in synthetic measurements, in addition to the encoder's resolution"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return inertia and friction, or only their ratios if the scale is unknown.

    .. math::
        (J_M + J_{dummy} + J_{added}) \dot\omega
        = K_T i - D_M \omega - \mathrm{sgn}(\omega)\,T_{BEARING}(\omega)

    Parameters
    ----------
    data
        One or several records of ``q_1`` [rad], ``i_1`` [A] as measured (even at zero demand, the
        falling back-EMF drives a current), and ``J_added`` [kg m^2], the known inertia on the
        shaft in addition to the dummy shaft.

    Raises
    ------
    ParameterError
        If a record does not coast.

    References
    ----------
    Roberts et al. (2003), sections "Motor", "Rollerscrew and bearings".
    """
    runs = [
        _read_run(label or "run", record, par, options) for label, record in split(data).items()
    ]
    names = _NAMES if _has_scale(runs) else _NAMES[1:]
    best = _fitted(runs, names)
    is_scaled = _INERTIA in best.names
    if not is_scaled and _INERTIA in names:
        best = _fitted(runs, _NAMES[1:])
    sources = _by_source(runs) if is_scaled else {}
    return Identified(
        estimates={"inertia and friction" if is_scaled else "friction at the given inertia": best},
        parameters=best.parameters() if is_scaled else {},
        figures=_ratios(best, par)
        | {f"inertia_by_{k}": (value, "kg*m**2") for k, (value, _) in sources.items()},
        checks=(_fits(runs, best), *_agreement(sources)),
        curves=(_curve(runs, best),),
        notes=() if is_scaled else (_no_scale(par),),
    )


def _no_scale(par: WedgeParameters) -> str:
    return (
        "the data do not determine the inertia. A run-down alone determines only the ratios of "
        "friction and damping to inertia. These ratios are valid. The torques assume motor_1.J_M = "
        f"{shown(par.motor_1.J_M, 'kg*m**2')}. Add a record with a known inertia on the shaft "
        "(J_added), or with a known current while the shaft coasts"
    )


def _agreement(sources: dict[str, tuple[float, float]]) -> tuple[Check, ...]:
    if len(sources) < 2:
        return ()
    (a, da), (b, db) = sources.values()
    note = (
        "inertia from the added inertia minus inertia from the current, relative to the standard "
        "deviation. A wrong torque constant makes them differ"
    )
    value = abs(a - b) / float(np.hypot(da, db))
    return (Check("inertias_agree", value, limit=_AGREE, note=note),)


def _fits(runs: Sequence[RunDown], best: Estimate) -> Check:
    """Check whether a separate cubic in speed for each record fits better."""
    residuals = _residuals_of(runs, best)
    rows, columns, weights = sum(map(len, residuals)), [], []
    begin = 0
    for run, e in zip(runs, residuals, strict=True):
        speed = run.motion.means(run.motion.data["omega"].values)
        cubic = np.zeros((rows, 4))
        cubic[begin : begin + e.size] = np.vander(speed / np.abs(speed).max(), 4)
        columns.append(cubic)
        weights.append(np.full(e.size, 1.0 / max(float(np.std(e)), 1e-300)))
        begin += e.size
    return lack_of_fit(
        "torque_left_over",
        np.concatenate(residuals),
        np.concatenate(weights),
        np.hstack(columns),
        len(best.values),
        "whether friction versus speed deviates from the laws",
    )


def _ratios(best: Estimate, par: WedgeParameters) -> dict[str, tuple[float, str]]:
    """Return friction and damping divided by the inertia of motor and dummy shaft."""
    values = best.parameters()
    J = values.get(_INERTIA, par.motor_1.J_M) + par.rig.J_dummy
    return {
        f"{name}_per_inertia": (values[name] / J, unit)
        for name, unit in _RATIOS.items()
        if name in values
    }


def _curve(runs: Sequence[RunDown], best: Estimate) -> Curve:
    """Return the decelerating torque versus speed, measured and modeled."""
    values = best.parameters()
    speeds, table = [], []
    for run, e in zip(runs, _residuals_of(runs, best), strict=True):
        J = values.get(_INERTIA, run.par.motor_1.J_M) + run.par.rig.J_dummy
        moved = run.motion.data
        torque = run.motion.means(J * moved["alpha"].values)
        speeds.append(run.motion.means(moved["omega"].values))
        table.append(np.array((-torque, -torque + e)))
    x, filled = at_own_places(speeds, table)
    return Curve(
        "torque-over-speed",
        "Estimated inertia times deceleration versus speed while coasting.",
        over(
            ("omega", x, "rad/s", "motor speed"),
            {"measured": filled[0], "modeled": filled[1]},
            "N*m",
            "decelerating torque",
            ("record", [run.label for run in runs]),
        ),
        "omega",
    )


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the three simulated run-downs from random angles, with sensor noise."""
    experiment = run_down.EXPERIMENT
    random = np.random.default_rng(seed)
    sensors = {"q_1": Sensor("q_1", options.sigma_q), "i_1": Sensor("i_1", options.sigma_i)}
    records = {}
    for case in experiment.cases(par, experiment.defaults, None):
        record = sensed(turned(case, random.uniform(0.0, 2.0 * np.pi)), sensors, random)
        more = case.par.rig.J_dummy - par.rig.J_dummy  # type: ignore[attr-defined]
        attrs = {"units": "kg*m**2", "long_name": "added inertia"}
        added = np.full(record.sizes["time"], more)
        records[case.label] = record.assign(J_added=("time", added, attrs))
    return joined(records)


METHOD = Method(
    name="run-down",
    assembly="wedge-brake",
    summary="inertia, bearing friction and damping from coasting with a known inertia or current",
    experiment="run-down",
    signals={"i_1": "A", "q_1": "rad", "J_added": "kg*m**2"},
    options=Options,
    defaults=Options(
        slowest=20.0, margin=0.035, window=0.01, cutoff=100.0, sigma_i=0.02, sigma_q=1e-4
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_i", "sigma_q"),
    unknowns=_NAMES,
    several=True,
)
