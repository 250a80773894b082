"""Properties for the clamp force estimate, from a stroke that applies and releases.

The ECU's own training fits the same equation sample by sample. This method fits a recorded stroke,
for example at the end of the assembly line, and gives the training its starting values.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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
    low_passed,
    parameters_of,
    simulate,
    wrong_sign,
)
from bywire.control import clamp_force_estimator as estimator
from emb_caliper.experiments import apply_release
from emb_caliper.parameters import CaliperBrakeParameters

Array = NDArray[np.float64]
MotorSpeed = Annotated[float, Unit("rad/s", 5.0), Field(gt=0, allow_inf_nan=False)]

_NAMES = tuple(f"ecu.estimator.{name}" for name in ("theta_0", "s", "C_hat", "G_hat"))
_STEP = 20e-6
_ANGLES = 80  # contact angles that are tried before the fit
_LEAST = 20  # samples in each direction
_SMALL = 1e-2  # fraction of the torque below which residuals are not checked
_ADVICE = "Apply to at least 30 % of full scale and release, as 'bywire run apply-release' does"


class Options(ParameterSet):
    """Evaluated part of the stroke, filter, and the synthetic noise."""

    slowest: MotorSpeed
    """minimum speed; below it breakaway dominates"""
    margin: Duration
    """time to omit before and after each sample below the minimum speed"""
    cutoff: Frequency
    """cutoff frequency of the low-pass filter"""
    sigma_i: Annotated[float, Unit("A", 0.1), Field(ge=0)]
    """current noise in synthetic measurements"""
    counts: Annotated[float, Unit("1", 4096.0), Field(gt=0)]
    """counts per revolution of the angle sensor in synthetic measurements"""


def identify(
    data: xr.Dataset, par: CaliperBrakeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return contact angle, stiffness scale, and friction without load and per clamp force.

    .. math:: K_t i - D \omega - J \dot\omega
        = \gamma F + \mathrm{sgn}(\omega) (C + G F), \quad F = s f(\gamma (\theta - \theta_0))

    Both sides go through the same low-pass filter. Torque constant, inertia, viscous friction,
    ratio and the shape of the curve must be known.

    Parameters
    ----------
    data
        ``i`` [A], ``theta`` [rad].

    Raises
    ------
    ParameterError
        If the stroke does not apply and release, or if a sign is wrong.
    """
    signals = data[["i", "theta"]]
    moved = differentiated(signals, "theta", ("omega", "alpha"), options.cutoff)
    omega, alpha = moved["omega"].values, moved["alpha"].values
    of = par.ecu.estimator
    torque = par.ecu.K_t_hat * moved["i"].values - of.D_hat * omega - of.J_hat * alpha
    interval = float(data["time"].values[1] - data["time"].values[0])
    rows = _moving(omega, interval, options)
    way = np.sign(omega)
    if min(np.sum(way[rows] > 0.0), np.sum(way[rows] < 0.0)) < _LEAST:
        raise ParameterError(f"the data do not contain a stroke in both directions. {_ADVICE}")
    smoothed = _filter(interval, options.cutoff)
    regress = _Regressors(data["theta"].values, way, rows, of, smoothed)
    starts = _best_start(torque[rows], regress)
    fitted = regress.torque(starts)[0] - torque[rows]
    if starts[1] <= 0.0:
        raise wrong_sign("i", "theta", "with this motion, the clamp force would be negative")
    scatter = max(float(np.sqrt(np.mean(fitted**2))), 1e-12)

    def residual(p: Array) -> tuple[Array, Array]:
        value, slope = regress.torque(p)
        return (value - torque[rows]) / scatter, slope / scatter

    unknowns = parameters_of(par, _NAMES, dict(zip(_NAMES, map(float, starts), strict=True)))
    best = estimate(Problem(unknowns, residual))
    values = {u.name: u.start for u in unknowns} | best.parameters()
    value, slope = regress.torque(np.array([values[name] for name in _NAMES]))
    size = slope[:, 3]  # the clamp force in the direction of motion
    scale = np.abs(size) / max(float(np.max(np.abs(size))), 1e-12)
    richer = np.column_stack((slope, scale**2, way[rows] * scale**2))
    check = lack_of_fit(
        "torque_left_over",
        value - torque[rows],
        np.full(value.size, 1.0 / scatter),
        richer,
        len(_NAMES),
        "whether the curve has another shape, the pads have hysteresis, or friction is nonlinear",
    )
    return Identified(
        estimates={"estimator": best},
        parameters=best.parameters(),
        checks=(check,),
        curves=(_curve(moved["theta"].values[rows], torque[rows], value),),
        notes=(
            "an error of the torque constant changes the stiffness scale by at least the same "
            "percentage",
        ),
    )


class _Regressors:
    """Filtered load torque of the moving samples, and its sensitivities."""

    def __init__(
        self,
        theta: Array,
        way: Array,
        rows: NDArray[np.intp],
        of: estimator.Parameters,
        smoothed: Callable[[Array], Array],
    ) -> None:
        self.theta, self.way, self.rows = theta, way, rows
        self.of, self.smoothed = of, smoothed
        self.unloaded = smoothed(way)[rows]

    def curve(self, theta_0: float) -> tuple[Array, Array]:
        """Return force and stiffness of the curve at every sample."""
        n = np.clip(self.of.gamma * (self.theta - theta_0), 0.0, self.of.n_max)
        slope = np.asarray(estimator.slope(n, self.of))
        return np.asarray(estimator.force(n, self.of)), np.where(n > 0.0, slope, 0.0)

    def linear(self, theta_0: float) -> Array:
        """Return the sensitivities to s, C and s G, shape (rows, 3)."""
        f, _ = self.curve(theta_0)
        columns = self.of.gamma * self.smoothed(f)[self.rows], self.unloaded
        return np.column_stack((*columns, self.smoothed(self.way * f)[self.rows]))

    def torque(self, p: Array) -> tuple[Array, Array]:
        """Return torque and its sensitivities to theta_0, s, C and G, shape (rows, 4)."""
        theta_0, s, C, G = p
        f, slope = self.curve(theta_0)
        per_force = self.of.gamma + self.way * G
        h_t = -self.smoothed(per_force * s * self.of.gamma * slope)[self.rows]
        h_s = self.smoothed(per_force * f)[self.rows]
        h_G = self.smoothed(self.way * s * f)[self.rows]
        return s * h_s + C * self.unloaded, np.column_stack((h_t, h_s, self.unloaded, h_G))


def _filter(interval: float, cutoff: float) -> Callable[[Array], Array]:
    return lambda values: np.asarray(low_passed(values, interval, cutoff))


def _moving(omega: Array, interval: float, options: Options) -> NDArray[np.intp]:
    """Return the samples that are far enough from rest and from a reversal, one per filter time."""
    slow = (np.abs(omega) < options.slowest).astype(float)
    size = 2 * round(options.margin / interval) + 1
    near = np.convolve(slow, np.ones(size), mode="same") > 0.5
    near[: size // 2], near[-(size // 2) :] = True, True  # the filter's ends
    # Noise of neighboring samples is correlated by the filter.
    apart = max(round(0.25 / (options.cutoff * interval)), 1)
    return np.flatnonzero(~near)[::apart]


def _best_start(torque: Array, regress: _Regressors) -> Array:
    """Return the properties with the smallest deviation for any contact angle."""
    low, high = float(regress.theta.min()), float(regress.theta.max())
    best, least = np.zeros(4), np.inf
    for theta_0 in np.linspace(low, high, _ANGLES, endpoint=False):
        W = regress.linear(float(theta_0))
        found = np.linalg.lstsq(W, torque, rcond=None)[0]
        left = float(np.sum((W @ found - torque) ** 2))
        if left < least and found[0] > 0.0:
            best, least = np.array([theta_0, found[0], found[1], found[2] / found[0]]), left
    best[2:] = np.maximum(best[2:], 0.0)
    return best


def _curve(theta: Array, torque: Array, fitted: Array) -> Curve:
    """Return load torque versus angle, measured and modeled."""
    order = np.argsort(theta)
    attrs = {"units": "N*m", "long_name": "load torque"}
    columns = {"measured": torque[order], "modeled": fitted[order]}
    return Curve(
        "load-torque",
        "Load torque while applying (top) and releasing (bottom) versus motor angle.",
        xr.Dataset(
            {name: ("theta", values, attrs) for name, values in columns.items()},
            {"theta": ("theta", theta[order], {"units": "rad", "long_name": "motor angle"})},
        ),
        "theta",
    )


def synthetic(par: CaliperBrakeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return a simulated stroke to 15 kN with current noise and a quantized angle."""
    experiment = apply_release.EXPERIMENT
    stroke = experiment.defaults.replace({"F_top": 15e3})
    (case,) = experiment.cases(par, stroke, None)
    recorded = replace(case, record=par.ecu.T_current)
    computed = simulate(as_run(recorded, _STEP), ("i", "theta"))
    random = np.random.default_rng(seed)
    count = 2.0 * np.pi / options.counts
    theta = count * np.floor(computed["theta"] / count + 0.5)
    i = computed["i"] + random.normal(0.0, options.sigma_i, computed.time.size)
    return xr.Dataset(
        {"i": ("time", i, {"units": "A"}), "theta": ("time", theta, {"units": "rad"})},
        {"time": ("time", computed.time, {"units": "s", "long_name": "time"})},
    )


METHOD = Method(
    name="clamp-force-strokes",
    assembly="emb-caliper",
    summary="contact angle, stiffness and friction for the clamp force estimate, apply-release",
    experiment="apply-release",
    signals={"i": "A", "theta": "rad"},
    options=Options,
    defaults=Options(slowest=5.0, margin=0.03, cutoff=30.0, sigma_i=0.1, counts=4096.0),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_i", "counts"),
    unknowns=_NAMES,
)
