"""Friction from a slow current ramp up and down (2010, eqs. 16 and 17, Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.methods.stick_slip import (
    Fitted,
    Shooting,
    Shot,
    cut_out,
    find_slips,
    require_calm,
    require_reachable,
)
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core import ops
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, Unit
from bywire.core.typing import Array
from bywire.data.labeled import labeled
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import noise_of, wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.multistart import Search, nearer, search
from bywire.identification.output_error import even_interval, trial
from bywire.identification.unknown import Unknown, parameters_of, scattered
from bywire.plant import seal_friction
from bywire.simulation.run import simulate

# Curves of an identified friction: torque versus speed with its band, and the replayed ramp.

_SHARE = 1e-6


def stribeck_band(
    par: seal_friction.Parameters, estimate: Estimate, pressures: Sequence[float], omega: Array
) -> xr.Dataset:
    """Return friction torque versus speed with 95 % bands, at several pressures.

    ``par``: the identified friction; ``estimate``: estimate of ``seal.*`` parameters;
    ``pressures``: [Pa]; ``omega``: shaft speeds [rad/s], shape (n,).

    Returns
    -------
    xarray.Dataset
        ``value``, ``low``, ``high`` [N m] over ``pressure`` and ``omega``. NaN at zero speed,
        where the friction can have any value between its breakaway torques.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (16), Fig. 4.
    """
    seal = [k for k, u in enumerate(estimate.unknowns) if u.name.startswith("seal.")]
    unknowns = [estimate.unknowns[k] for k in seal]
    names = [u.name.removeprefix("seal.") for u in unknowns]
    value = np.array([[_torque(par, w, p) for w in omega] for p in pressures])
    slopes = []
    for name, unknown in zip(names, unknowns, strict=True):
        by = _SHARE * unknown.scale
        up = par.replace({name: getattr(par, name) + by})
        moved = np.array([[_torque(up, w, p) for w in omega] for p in pressures])
        slopes.append((moved - value) / by)
    G = np.array(slopes)
    variance = np.einsum("ipw,ij,jpw->pw", G, estimate.covariance[np.ix_(seal, seal)], G)
    half = 0.5 * np.diff(estimate.intervals(), axis=1).ravel() / estimate.deviations
    reach = float(half[0]) * np.sqrt(np.maximum(variance, 0.0))
    axes = {
        "pressure": (np.array(pressures), "Pa", "pressure"),
        "omega": (omega, "rad/s", "motor speed"),
    }
    band = {"value": value, "low": value - reach, "high": value + reach}
    return labeled(axes, {name: (T, "N*m", "friction torque") for name, T in band.items()})


def _torque(par: seal_friction.Parameters, omega: float, p: float) -> float:
    if omega == 0.0:
        return float("nan")
    friction = seal_friction.output(seal_friction.Input(omega, p), par)
    return float(ops.where(omega > 0.0, friction.T_p, -friction.T_n))


def replayed(data: xr.Dataset, par: MotorcycleParameters, step: float) -> xr.Dataset:
    """Return measured and modeled pressure over the whole ramp, driven by the current.

    ``data``: ``i`` [A] and ``p_mc`` [Pa] over ``time`` [s]; ``step``: substep [s].
    """
    driven_par = par.replace({"drive.mode": "current-source"})
    start = max(float(data["p_mc"][0]), 0.0)
    whole = trial(
        MotorcycleBrake(),
        driven_par,
        data,
        {"i_set": "i"},
        {"p_mc": 1.0},
        state=state_at(start, driven_par),
        memory=memory_at(start, driven_par),
        step=step,
    )
    modeled = simulate(whole.run, ("p_mc",))["p_mc"]
    attrs = {"units": "Pa", "long_name": "master-cylinder pressure"}
    return xr.Dataset(
        {"measured": ("time", data["p_mc"].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )


# Friction from the shapes of a ramp's slips and from their breakaway currents.

_BLOCKS = 250  # maximum


class Whitening:
    r"""Whitening filter: makes means of neighboring residuals independent, with unit variance.

    .. math:: \Sigma = \sigma^2 I + P H H^T P \sigma_i^2

    H is the pressure's response to every sample of the current. It is derived from the response to
    a constant offset, as if the slip's response did not change with time. P projects out a time
    shift.

    Parameters
    ----------
    fitted
        A simulated slip.
    sigma, sigma_i
        Noise of a pressure sample [Pa], and of a sample of the current [A] that drives the slip;
        0 if no measured current drives the slip.
    """

    def __init__(self, fitted: Fitted, sigma: float, sigma_i: float) -> None:
        self._block = max(-(-fitted.residuals.size // _BLOCKS), 1)
        self._sigma = sigma / np.sqrt(self._block)
        self._root = self._root_of(fitted, sigma_i) if sigma_i > 0.0 else None

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (n,) or (n, p), as fewer independent rows."""
        from scipy import linalg

        means: Array = self._means(values) / self._sigma
        if self._root is None:
            return means
        return np.asarray(linalg.solve_triangular(self._root, means, lower=True))

    def _root_of(self, fitted: Fitted, sigma_i: float) -> Array:
        """Return the root of the covariance, in units of the pressure's noise."""
        answer = np.diff(self._means(fitted.answer), prepend=0.0)
        count = answer.size
        back = np.arange(count)[:, None] - np.arange(count)[None, :]
        H = np.where(back >= 0, answer[np.clip(back, 0, count - 1)], 0.0)
        v = self._means(fitted.speed)
        H -= np.outer(v, v @ H) / max(float(v @ v), 1e-300)
        H *= sigma_i / (np.sqrt(self._block) * self._sigma)
        covariance = H @ H.T
        covariance[np.diag_indices(count)] += 1.0
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)

    def _means(self, values: Array) -> Array:
        count = len(values) // self._block
        parts = values[: count * self._block].reshape(count, self._block, *values.shape[1:])
        return np.asarray(parts.mean(axis=1))


@dataclass(frozen=True)
class Noise:
    """Noise of the measurements.

    ``pressure``, ``current``: standard deviation of a sample's noise [Pa], [A]; ``scatter``:
    standard deviation of the breakaway current from slip to slip [A].
    """

    pressure: float
    current: float
    scatter: float

    def of_breakaway(self, shot: Shot) -> float:
        """Return the standard deviation of the current [A] measured at the start of a shot.

        It has three parts: the error at the end of a line through a few noisy samples, the current
        ripple at rest (any of its peaks can free the piston), and other scatter.
        """
        read = 2.0 * self.current / np.sqrt(shot.seen)
        ripple = np.sqrt(max(shot.unrest**2 - self.current**2, 0.0))
        return float(np.sqrt(read**2 + ripple**2 + self.scatter**2))


class SlipLoss:
    """Weighted residuals of all slips versus friction parameters, current offset and ripple.

    Parameters
    ----------
    shooting, shots, noise
        The model, the measured slips, and their noise.
    weighted_at
        Values at which the weights are computed. The measured current then drives the slips. The
        Jacobian is free of the current's noise, so it serves as an instrument. None for the search:
        only the ramp drives the slips, which is fast and gives few minima.
    """

    def __init__(
        self,
        shooting: Shooting,
        shots: Sequence[Shot],
        noise: Noise,
        weighted_at: Array | None = None,
    ) -> None:
        self._shooting, self._shots, self._noise = shooting, shots, noise
        self._whitenings: list[Whitening] | None = None
        if weighted_at is not None:
            zero = float(weighted_at[-2])
            fits = (shooting.fit(s, weighted_at[: shooting.count], zero) for s in shots)
            self._whitenings = [Whitening(fitted, noise.pressure, noise.current) for fitted in fits]

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return residuals and Jacobian: the slips' shapes, then one row for every breakaway.

        ``values``: friction parameters, zero offset of the current sensor [A], and height of the
        current's peaks above its mean [A].
        """
        seal, zero, ripple = values[: self._shooting.count], float(values[-2]), float(values[-1])
        driven = zero if self._whitenings is not None else None
        residuals, slopes, begun, begun_slopes = [], [], [], []
        for k, shot in enumerate(self._shots):
            fitted, way = self._shooting.fit(shot, seal, driven), shot.slip.direction
            whiten = (
                Whitening(fitted, self._noise.pressure, 0.0)
                if self._whitenings is None
                else self._whitenings[k]
            )
            sure = self._noise.of_breakaway(shot)
            residuals.append(whiten(fitted.residuals))
            none = np.zeros(fitted.residuals.size)
            slopes.append(whiten(np.column_stack((fitted.slopes, -fitted.by_current, none))))
            begun.append((fitted.breakaway - zero + way * ripple) / sure)
            begun_slopes.append(np.array([*fitted.breakaway_slopes, -1.0, way]) / sure)
        return np.concatenate((*residuals, begun)), np.vstack((*slopes, *begun_slopes))


_NAMES = ("T_pr", "f_cfr_p", "f_cfr_n", "k_brk_p", "k_brk_n", "c", "mu_T")
_ZERO, _RIPPLE = "offset.i", "offset.i_ripple"
# The multistart search uses a coarse time step. It first fits only the initial part of each slip,
# with the parameters fixed that this part hardly determines: this fit has few minima. A full fit
# then refines the best minimum.
_QUICK_STEP, _BEGINNING, _QUICK_LENGTH = 1e-4, 0.6, 4.0  # s
_HARDLY_TOLD = ("seal.c", "seal.mu_T")
_LIMIT_REPLAY, _LIMIT_RESIDUAL, _LIMIT_ZERO, _LIMIT_RIPPLE = 0.1, 1.1, 5.0, 3.0


class Options(ParameterSet):
    """Definition of a slip, and noise of the measurements."""

    least: Pressure
    """minimum pressure change to be treated as a slip"""
    longest: Duration
    """maximum duration of each slip in the fit"""
    scatter: Current
    """standard deviation of the breakaway current from slip to slip, in addition to measurement
    noise and ripple"""
    zero: Current
    """standard deviation of the current sensor's zero offset, which all slips share"""
    ripple: Current
    """standard deviation of the breakaway current's height above the mean current: the piston
    breaks away at a ripple peak"""
    sigma_p: Annotated[float, Unit("Pa", 2e3), Field(ge=0)]
    """noise of the pressure in synthetic measurements"""
    sigma_i: Annotated[float, Unit("A", 1e-2), Field(ge=0)]
    """noise of the current in synthetic measurements, both recorded and used by the controller"""
    step: Duration
    """substep of the slip simulations"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return the friction parameters, including T_pr.

    Parameters
    ----------
    data
        ``i``: measured motor current [A]; ``p_mc``: pressure [Pa]. Do not use the current demand
        instead of the current: the current lags it while the shaft turns fast, which biases the
        estimates.
    par
        Known parameters. The motor and the current controller matter: they make the current dip
        below its ramp as a slip begins. Dither is off.

    Raises
    ------
    ParameterError
        When the record contains no slip, or a pressure that the brake cannot reach.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 4.1. The loss function is `SlipLoss`.
    """
    shots = shots_of(data, options)
    require_reachable(shots, par)
    require_calm(shots, noise_of(data["i"].values), _LIMIT_RIPPLE * options.ripple)
    led, best = _fitted(data, par, options, effort)
    values = best.parameters()
    identified_par = par.replace(values)
    zero = best[_ZERO] if _ZERO in best.names else 0.0
    whole = replayed(data.assign(i=data["i"] - zero), identified_par, options.step)
    error = whole["modeled"] - whole["measured"]
    nrmse = float(np.sqrt((error**2).mean()) / np.ptp(data["p_mc"].values))
    return Identified(
        estimates={"seal friction": best},
        parameters=values,
        checks=(
            Check(
                "residual_over_noise",
                best.rms,
                limit=_LIMIT_RESIDUAL,
                note="aligned slips: ratio of residual to sensor noise",
            ),
            Check(
                "replay_nrmse",
                nrmse,
                limit=_LIMIT_REPLAY,
                note="whole ramp: rms error relative to the pressure range",
            ),
            Check(
                "zero_over_usual",
                abs(zero) / options.zero,
                limit=_LIMIT_ZERO,
                note="zero offset of the current sensor relative to its usual size. A pressure "
                "sensor offset, a wrong unit or a wrong torque constant also increases it",
            ),
            Check("starts_at_minimum", led.reached / effort.starts),
        ),
        curves=(
            Curve(
                "ramp",
                "Pressure on the ramp: measured, and simulated with the estimates.",
                whole,
                "time",
            ),
            _stribeck(identified_par, best),
        ),
        notes=(
            _counted(shots),
            f"{led.reached} of {effort.starts} starts reached the minimum",
        ),
    )


def _fitted(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> tuple[Search, Estimate]:
    """Return the multistart search, and the full fit from its best minimum."""
    known = {_ZERO: options.zero, _RIPPLE: options.ripple}
    unknowns = (
        *parameters_of(par, [f"seal.{name}" for name in _NAMES]),
        *(Unknown(k, 0.0, scale=v, unit="A", prior=(0.0, v)) for k, v in known.items()),
    )
    beginning, longer = (
        _problem(data, par, _quick(options, length), unknowns)
        for length in (_BEGINNING, _QUICK_LENGTH)
    )
    led = search(
        longer,
        scattered(unknowns, effort.starts, effort.spread, effort.seed),
        "linear",
        effort.progress,
        effort.store,
        effort.threads,
        partial(nearer, beginning, _HARDLY_TOLD),
    )
    at = led.best.values
    best = estimate(_problem(data, par, options, unknowns, at), start=at)
    if not any(name.startswith("seal.") for name in best.names):
        raise ParameterError(
            "the slips and this current do not determine the seal friction. Check the units of "
            "i and p_mc, and the known parameters motor.K_e, gear and cylinder",
            name="i",
        )
    return led, best


def _quick(options: Options, length: float) -> Options:
    return options.replace(
        {"step": max(_QUICK_STEP, options.step), "longest": min(length, options.longest)}
    )


def _problem(
    data: xr.Dataset,
    par: MotorcycleParameters,
    options: Options,
    unknowns: tuple[Unknown, ...],
    weighted_at: Array | None = None,
) -> Problem:
    shots = shots_of(data, options)
    noise = Noise(
        max(noise_of(data["p_mc"].values), 1.0), noise_of(data["i"].values), options.scatter
    )
    loss, finer = (
        SlipLoss(Shooting(par, unknowns[: len(_NAMES)], step), shots, noise, weighted_at)
        for step in (options.step, 0.5 * options.step)
    )
    is_final = weighted_at is not None
    return Problem(
        unknowns, loss, apart=len(shots), instrument=is_final, finer=finer if is_final else None
    )


def shots_of(data: xr.Dataset, options: Options) -> list[Shot]:
    """Return the measured slips.

    Raises
    ------
    ParameterError
        When the record contains no slip, or the pressure falls while the current rises.
    """
    t, p, i = (data[name].values for name in ("time", "p_mc", "i"))
    together = float(np.mean((p - p.mean()) * (i - i.mean())) / max(p.std() * i.std(), 1e-300))
    if together < 0.0:
        raise wrong_sign("p_mc", "i", f"correlation {together:.2f}")
    slips = find_slips(p, even_interval(t), options.least)
    if not slips:
        raise ParameterError(
            f"p_mc contains no slip larger than least = {options.least / 1e5:g} bar, so the record "
            "does not determine the friction. Ramp the current slowly up and down, without dither",
            name="p_mc",
        )
    return cut_out(t, p, i, slips, options.longest)


def _counted(shots: Sequence[Shot]) -> str:
    up = sum(shot.slip.direction > 0 for shot in shots)
    return f"slips: {up} up, {len(shots) - up} down"


def _stribeck(par: MotorcycleParameters, fit: Estimate) -> Curve:
    return Curve(
        "stribeck",
        "Identified Stribeck curves with 95 % bands (Fig. 4).",
        stribeck_band(par.seal, fit, (2e5, 20e5, 40e5), np.linspace(-2.0, 2.0, 201)),
        "omega",
    )


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return a simulated ramp of eq. (17) without dither, with sensor noise."""
    sensor = par.current_sensor
    share = options.sigma_i / (sensor.i_high - sensor.i_low)
    noisy_par = par.replace({"adc.noise": float(np.hypot(par.adc.noise, share))})
    case = friction_ramp.EXPERIMENT.cases(noisy_par, friction_ramp.EXPERIMENT.defaults, None)[0]
    computed = simulate(as_run(case, 20e-6, seed=(seed,)), ("i", "p_mc"))
    random = np.random.default_rng(seed)
    noise = random.normal(0.0, options.sigma_p, computed.time.size)
    noise_i = random.normal(random.normal(0.0, options.zero), options.sigma_i, computed.time.size)
    return xr.Dataset(
        {
            "i": ("time", computed["i"] + noise_i, {"units": "A"}),
            "p_mc": ("time", computed["p_mc"] + noise, {"units": "Pa"}),
        },
        {"time": ("time", computed.time, {"units": "s"})},
    )


METHOD = Method(
    name="friction-ramp",
    assembly="motorcycle-brake",
    summary="seal friction from breakaway and slips on a slow ramp (section 4.1 of Dardanelli et "
    "al.)",
    experiment="friction-ramp",
    signals={"i": "A", "p_mc": "Pa"},
    options=Options,
    defaults=Options(
        least=0.2e5,
        longest=6.0,
        scatter=5e-4,
        zero=2e-3,
        ripple=1e-2,
        sigma_p=2e3,
        sigma_i=3e-3,
        step=20e-6,
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_p", "sigma_i"),
    unknowns=tuple(f"seal.{name}" for name in _NAMES),
    further={
        _ZERO: ("A", "zero offset of the current sensor"),
        _RIPPLE: ("A", "height of the current's peaks above its mean"),
    },
)
