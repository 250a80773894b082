"""Friction versus load and speed, from slow strokes of the whole brake."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from bywire.authoring import (
    Curve,
    Duration,
    Effort,
    Frequency,
    Identified,
    Method,
    ParameterError,
    ParameterSet,
    Problem,
    Unit,
    as_run,
    differentiated,
    estimate,
    lack_of_fit,
    parameters_of,
    simulate,
    wrong_sign,
)
from emb_caliper.ecu import travel_per_angle
from emb_caliper.experiments import slow_strokes
from emb_caliper.parameters import CaliperBrakeParameters

Array = NDArray[np.float64]
MotorSpeed = Annotated[float, Unit("rad/s", 5.0), Field(gt=0, allow_inf_nan=False)]

_NAMES = ("friction.C", "friction.G", "rotor.D")
_STEP = 20e-6
_SMALL = 1e-3  # fraction of the friction below which residuals are not checked
_SPREAD = 1.5  # minimum ratio of loads, and of speeds, that separates the parts of the friction
_ADVICE = "Go to a high clamp force and back at two speeds, as 'bywire run slow-strokes' does"


class Options(ParameterSet):
    """Evaluated part of the strokes, filters, and the synthetic noise."""

    slowest: MotorSpeed
    """minimum speed of a stroke; below it breakaway dominates"""
    margin: Duration
    """time to omit at the start and end of each stroke"""
    window: Duration
    """averaging window of the torque balance"""
    cutoff: Frequency
    """cutoff frequency of the low-pass filter before the angle is differentiated"""
    sigma_i: Annotated[float, Unit("A", 0.05), Field(ge=0)]
    """current noise in synthetic measurements"""
    sigma_F: Annotated[float, Unit("N", 20.0), Field(ge=0)]
    """clamp force noise in synthetic measurements"""
    sigma_theta: Annotated[float, Unit("rad", 1e-3), Field(ge=0)]
    """angle noise in synthetic measurements"""


def identify(
    data: xr.Dataset, par: CaliperBrakeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return sliding friction without load, friction per clamp force, and viscous friction.

    .. math:: K_e i - N F_{cl} - J \dot\omega = \mathrm{sgn}(\omega) (C + G F_{cl}) + D \omega

    The balance is averaged over windows within the strokes. Torque constant, ratio and inertia must
    be known.

    Parameters
    ----------
    data
        ``i`` [A], ``theta`` [rad], ``F_cl`` [N].

    Raises
    ------
    ParameterError
        If strokes, loads or speeds do not determine the friction, or if a sign is wrong.
    """
    signals = data[["i", "theta", "F_cl"]]
    moved = differentiated(signals, "theta", ("omega", "alpha"), options.cutoff)
    rows = list(_windows(moved, options))
    if not rows:
        raise ParameterError(
            f"the motor does not stay above {options.slowest:g} rad/s long enough. {_ADVICE}"
        )
    mean = {
        n: np.array([moved[n].values[r].mean() for r in rows])
        for n in ("i", "F_cl", "omega", "alpha")
    }
    _require_spread(mean)
    torque = par.motor.K_e * mean["i"] - travel_per_angle(par) * mean["F_cl"]
    torque = torque - par.rotor.J * mean["alpha"]
    way = np.sign(mean["omega"])
    if float(np.median(torque * way)) < 0.0:
        raise wrong_sign("i", "theta", "with this motion, the drive train would gain power")
    W = np.column_stack((way, way * mean["F_cl"], mean["omega"]))
    unknowns = parameters_of(par, _NAMES)
    scatter = _scatter(torque, W)
    problem = Problem(unknowns, lambda p: ((W @ p - torque) / scatter, W / scatter))
    best = estimate(problem)
    values = {u.name: u.start for u in unknowns} | best.parameters()
    fitted = W @ np.array([values[name] for name in _NAMES])
    scale = mean["F_cl"] / float(np.max(mean["F_cl"]))
    richer = np.column_stack((W, way * scale**2, way * scale * np.abs(mean["omega"])))
    check = lack_of_fit(
        "torque_left_over",
        fitted - torque,
        np.full(torque.size, 1.0 / scatter),
        richer,
        len(_NAMES),
        "whether friction is nonlinear in the load, or its slope changes with speed",
    )
    if scatter < _SMALL * float(np.median(np.abs(torque))):
        # In a record without noise, even irrelevant deviations are significant.
        small = f"not checked, because the residual is below {100 * _SMALL:g} % of the friction"
        check = replace(check, limit=None, note=f"{check.note}; {small}")
    return Identified(
        estimates={"friction": best},
        parameters=best.parameters(),
        checks=(check,),
        curves=(_curve(mean["F_cl"], torque, fitted),),
        notes=("sliding strokes do not determine breakaway, so friction.T_s is unchanged",),
    )


def _windows(moved: xr.Dataset, options: Options) -> Iterator[slice]:
    """Yield the samples of each window within a stroke, from one reversal to the next."""
    time, omega = moved["time"].values, moved["omega"].values
    interval = float(time[1] - time[0])
    skip, size = round(options.margin / interval), max(round(options.window / interval), 4)
    way = np.where(np.abs(omega) > options.slowest, np.sign(omega), 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([0.0], way, [0.0]))))
    for begin, end in pairwise(edges):
        if way[begin] != 0.0:
            for k in range((end - begin - 2 * skip) // size):
                yield slice(begin + skip + k * size, begin + skip + (k + 1) * size)


def _require_spread(mean: dict[str, Array]) -> None:
    for name, parameter, unit in (("F_cl", "friction.G", "N"), ("omega", "rotor.D", "rad/s")):
        low, high = np.quantile(np.abs(mean[name]), (0.02, 0.98))
        if high < _SPREAD * low or high == 0.0:
            raise ParameterError(
                f"the data do not separate {parameter} from friction.C, because {name} stays "
                f"near {high:.3g} {unit}. {_ADVICE}"
            )


def _scatter(torque: Array, W: Array) -> float:
    left = torque - W @ np.linalg.lstsq(W, torque, rcond=None)[0]
    return max(float(np.sqrt(np.mean(left**2))), 1e-12)


def _curve(F: Array, torque: Array, fitted: Array) -> Curve:
    """Return friction torque versus clamp force, measured and modeled."""
    order = np.argsort(F)
    attrs = {"units": "N*m", "long_name": "friction torque in the direction of motion"}
    columns = {"measured": np.abs(torque[order]), "modeled": np.abs(fitted[order])}
    return Curve(
        "friction-over-load",
        "Friction torque in steady motion versus clamp force, one point per window.",
        xr.Dataset(
            {name: ("F_cl", values, attrs) for name, values in columns.items()},
            {"F_cl": ("F_cl", F[order], {"units": "N", "long_name": "clamp force"})},
        ),
        "F_cl",
    )


def synthetic(par: CaliperBrakeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return simulated slow strokes with sensor noise."""
    experiment = slow_strokes.EXPERIMENT
    (case,) = experiment.cases(par, experiment.defaults, None)
    noise = {"i": options.sigma_i, "theta": options.sigma_theta, "F_cl": options.sigma_F}
    computed = simulate(as_run(case, _STEP), tuple(noise))
    random = np.random.default_rng(seed)
    units = {"i": "A", "theta": "rad", "F_cl": "N"}
    return xr.Dataset(
        {
            n: (
                "time",
                computed[n] + random.normal(0.0, s, computed.time.size),
                {"units": units[n]},
            )
            for n, s in noise.items()
        },
        {"time": ("time", computed.time, {"units": "s", "long_name": "time"})},
    )


METHOD = Method(
    name="friction-strokes",
    assembly="emb-caliper",
    summary="dry friction at zero load and per clamp force, and viscous friction, slow strokes",
    experiment="slow-strokes",
    signals={"i": "A", "theta": "rad", "F_cl": "N"},
    options=Options,
    defaults=Options(
        slowest=5.0,
        margin=0.05,
        window=0.02,
        cutoff=60.0,
        sigma_i=0.05,
        sigma_F=20.0,
        sigma_theta=1e-3,
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_i", "sigma_F", "sigma_theta"),
    unknowns=_NAMES,
)
