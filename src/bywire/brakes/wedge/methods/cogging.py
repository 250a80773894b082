"""Cogging torque of a motor from slow rotation both ways (Roberts 2003, section "Motor").

Cogging depends on the angle and is the same in both directions; dry friction changes sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.brakes.wedge.case import turned
from bywire.brakes.wedge.experiments import slow_rotation
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import ParameterError, not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.confidence import uncertainty
from bywire.identification.differentiation import differentiated, low_passed
from bywire.identification.equation import windows
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.output_error import even_interval
from bywire.identification.trust import Sensor, sensed
from bywire.identification.unknown import Unknown
from bywire.plant import axial_bearing, servo_motor
from bywire.plant.axial_bearing import AngularSpeed

_LEVEL = 1e-3  # significance level: fraction of false alarms
_OTHER = 0.1  # maximum fraction of the cogging that the friction slope may explain
_FRICTION = ("T_forward", "T_backward", "friction_slope")
_FALSE = 1e-3  # probability that noise alone produces an order
_MOST = 8


@dataclass(frozen=True)
class Turning:
    """Samples of a slowly turning shaft, shapes (n,).

    Parameters
    ----------
    angle
        Shaft angle [rad].
    way
        1 forward, -1 backward.
    speed
        Magnitude [rad/s].
    torque
        Motor torque minus the torque that accelerates the inertia [N m].
    waves
        ``waves(order) -> (cosine, sine)`` of the angle, with the same filter as the torque.
    """

    angle: Array
    way: Array
    speed: Array
    torque: Array
    waves: Callable[[int], tuple[Array, Array]]

    @cached_property
    def leveled(self) -> Array:
        """Torque minus its mean in each direction."""
        rest = self.torque.copy()
        for way in (1.0, -1.0):
            rest[self.way == way] -= rest[self.way == way].mean()
        return rest

    @cached_property
    def friction_columns(self) -> Array:
        """Forward, backward, and the deviation of the speed from its mean in each direction."""
        ways = [self.way == way for way in (1.0, -1.0)]
        ripple = sum(way * (self.speed - self.speed[way].mean()) for way in ways)
        return np.column_stack((1.0 * ways[0], -1.0 * ways[1], self.way * ripple))


@dataclass(frozen=True)
class CoggingFit:
    """Fit of cogging and friction.

    Parameters
    ----------
    turning
        The data.
    orders
        Strongest first.
    estimate
        Solution of ``cogging_problem``.
    """

    turning: Turning
    orders: tuple[int, ...]
    estimate: Estimate

    @property
    def friction(self) -> Array:
        """Friction torque, shape (n,)."""
        values = [self.estimate[n] if n in self.estimate.names else 0.0 for n in _FRICTION]
        return np.asarray(self.turning.friction_columns @ np.array(values))


def cogging_problem(turning: Turning, orders: tuple[int, ...]) -> Problem:
    """Return the fit as a least-squares problem.

    Unknowns are the friction in both directions, its slope versus speed, and the amplitude and
    phase of every order. The first order has the names ``motor_1.T_cog`` and ``phase``, and the
    others have ``amplitude.N`` and ``phase.N``.
    """
    waves = [turning.waves(order) for order in orders]
    columns = np.column_stack((turning.friction_columns, *(w for pair in waves for w in pair)))
    start = np.linalg.lstsq(columns, turning.torque, rcond=None)[0]
    scatter = float(np.std(turning.torque - columns @ start)) or 1.0
    level = float(np.abs(start[:2]).max())
    unknowns = [
        Unknown(name, float(start[k]), scale=level, unit="N*m")
        for k, name in enumerate(_FRICTION[:2])
    ]
    unknowns.append(Unknown(_FRICTION[2], float(start[2]), scale=level, unit="N*m*s/rad"))
    for k, order in enumerate(orders):
        c, s = start[3 + 2 * k : 5 + 2 * k]
        amplitude, phase = float(np.hypot(c, s)), float(np.arctan2(c, s))
        names = ("motor_1.T_cog", "phase") if k == 0 else (f"amplitude.{order}", f"phase.{order}")
        unknowns.append(Unknown(names[0], amplitude, low=0.0, scale=amplitude, unit="N*m"))
        unknowns.append(Unknown(names[1], phase, scale=1.0, unit="rad"))

    def evaluate(values: Array) -> tuple[Array, Array]:
        e = turning.friction_columns @ values[:3] - turning.torque
        J = [turning.friction_columns]
        for k, (cosine, sine) in enumerate(waves):
            amplitude, phase = values[3 + 2 * k : 5 + 2 * k]
            wave = np.cos(phase) * sine + np.sin(phase) * cosine
            turned = np.cos(phase) * cosine - np.sin(phase) * sine
            e = e + amplitude * wave
            J.append(np.column_stack((wave, amplitude * turned)))
        return e / scatter, np.hstack(J) / scatter

    return Problem(tuple(unknowns), evaluate)


def _same_both_ways(cogging: CoggingFit) -> Check:
    r"""Check that the main order is the same in both directions, as cogging is.

    The check fits two more columns to the residual: cosine and sine with the sign of the
    direction. With their coefficients c and covariance C, :math:`c^T C^{-1} c / 2` is about one
    if friction does not depend on the angle.
    """
    from scipy import stats

    turning = cogging.turning
    cosine, sine = turning.waves(cogging.orders[0])
    columns = np.column_stack((turning.way * cosine, turning.way * sine))
    e = cogging.estimate.residuals
    c = np.linalg.lstsq(columns, e, rcond=None)[0]
    sure = uncertainty(columns, e - columns @ c)
    value = 0.5 * float(c @ np.linalg.solve(sure.covariance, c))
    limit = float(stats.f.isf(_LEVEL, 2, max(sure.freedom, 1.0)))
    note = (
        "part of the main order that changes sign with the direction, relative to its noise. "
        "Friction that depends on the angle causes it"
    )
    return Check("cogging_same_both_ways", value, limit=limit, note=note)


def _slope_as_known(cogging: CoggingFit, known: float) -> Check:
    """Check how much of the ripple the fit explains by a friction slope other than the known one.

    Cogging makes the speed ripple. Friction that depends on the angle then looks like friction
    that falls with speed, so an excess of the fitted slope over the known one may be either.

    ``known``: slope of friction versus speed according to its law [N m s/rad].
    """
    fit = cogging.estimate
    slope = fit["friction_slope"] if "friction_slope" in fit.names else known
    ripple = float(np.sqrt(2.0) * np.std(cogging.turning.friction_columns[:, 2]))
    share = abs(slope - known) * ripple / max(fit["motor_1.T_cog"], 1e-300)
    note = (
        "ripple that the fit explains by a friction slope beyond the friction law, relative to "
        "the cogging. Friction that depends on the angle causes it"
    )
    return Check("slope_beyond_law", share, limit=_OTHER, note=note)


def _amplitudes(angle: Array, torque: Array, highest: int) -> Array:
    """Return the amplitudes of the orders 1 to ``highest``, each fitted alone, shape (highest,).

    Parameters
    ----------
    angle
        [rad], shape (n,), spread (almost) evenly over whole revolutions.
    torque
        Torque minus its mean, shape (n,).
    """
    sizes = np.empty(highest)
    turn = np.exp(-1j * angle)
    wave = np.ones_like(turn)
    for order in range(highest):
        wave = wave * turn
        sizes[order] = 2.0 * abs(np.mean(wave * torque))
    return sizes


def _standing_out(angle: Array, torque: Array, highest: int) -> tuple[int, ...]:
    """Return the orders that stand out from the noise, strongest first.

    The noise power at an order has an exponential distribution. Its mean is the median over all
    orders divided by log 2. An order counts if its power is significantly larger than this mean,
    at a level that covers all orders together. The function subtracts one order after another, so
    a strong order does not leak into others.
    """
    residual, orders = torque - torque.mean(), list[int]()
    limit = math.log(highest / _FALSE) / math.log(2.0)
    while len(orders) < _MOST:
        power = _amplitudes(angle, residual, highest) ** 2
        best = int(np.argmax(power)) + 1
        if best in orders or power[best - 1] <= limit * float(np.median(power)):
            break
        orders.append(best)
        A = np.column_stack([f(n * angle) for n in orders for f in (np.cos, np.sin)])
        A = np.column_stack((np.ones(angle.size), A))
        residual = torque - A @ np.linalg.lstsq(A, torque, rcond=None)[0]
    return tuple(orders)


_ADVICE = (
    "Turn the shaft slowly through whole revolutions in both directions, as "
    "'bywire run slow-rotation' does"
)
_BINS = 36
_THINNED = 0.8  # cutoff frequency of the low-pass filter relative to half the new sample rate


class Options(ParameterSet):
    """Filters, orders, and the synthetic noise."""

    cutoff: Frequency
    """cutoff frequency of the filter for torque and angle; must be above the cogging frequency"""
    slowest: AngularSpeed
    """speed below which the shaft is considered to reverse"""
    margin: Duration
    """time to omit at the start and end of each motion"""
    highest: Annotated[int, Unit("1", 400.0), Field(ge=1, le=10000)]
    """maximum cogging order per revolution in the search"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """current noise in synthetic measurements"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return amplitude and phase of the cogging orders, and the friction in both directions.

    .. math::
        K_T i - J \dot\omega = \sum_n T_n \sin(n \theta + \varphi_n)
        \pm T_{FRICT} + d\,(\omega \mp \bar\omega)

    The last term is the change in friction due to the speed ripple.

    Parameters
    ----------
    data
        ``i_1`` [A], ``q_1`` [rad]. The torque constant and the inertia, including the dummy
        shaft, must be known.

    Raises
    ------
    ParameterError
        If the shaft turns in one direction only or not far enough, if no order exceeds the
        noise, or if a sign is wrong.

    References
    ----------
    Roberts et al. (2003), section "Motor": T_COG(theta).
    """
    turning = _turning(data, par, options)
    _require_braking(turning)
    orders = _standing_out(turning.angle, turning.leveled, options.highest)
    if not orders:
        raise ParameterError(
            f"no order up to {options.highest} exceeds the noise. Turn the shaft more slowly or "
            "through more revolutions, or raise options.highest",
            name="options.highest",
            value=str(options.highest),
        )
    best = estimate(cogging_problem(turning, orders))
    cogging = CoggingFit(turning, orders, best)
    main = orders[0]
    figures = {"order": (float(main), "1")}
    for k, order in enumerate(orders[1:], 2):
        figures[f"order_{k}"] = (float(order), "1")
        figures[f"amplitude_{k}"] = (best[f"amplitude.{order}"], "N*m")
    figures["friction_torque"] = (0.5 * (best["T_forward"] + best["T_backward"]), "N*m")
    figures["torque_offset"] = (0.5 * (best["T_forward"] - best["T_backward"]), "N*m")
    return Identified(
        estimates={"cogging and friction": best},
        parameters={"motor_1.T_cog": best["motor_1.T_cog"], "motor_1.N_cog": float(main)},
        figures=figures,
        checks=(_same_both_ways(cogging), _slope_as_known(cogging, _slope(par, turning))),
        curves=(_folded(cogging),),
        notes=_notes(best, orders),
    )


def _require_braking(turning: Turning) -> None:
    """Require that the motor drives the shaft in both directions, against the friction."""
    forward, backward = (float(turning.torque[turning.way == w].mean()) for w in (1.0, -1.0))
    friction = 0.5 * (forward - backward)
    if friction < 0.0:
        cause = f"friction of {friction:.3g} N*m would drive the shaft"
        raise wrong_sign("i_1", "q_1", cause)


def _slope(par: WedgeParameters, turning: Turning) -> float:
    """Return the slope of the known friction versus speed, at the test speed."""
    speed = float(turning.speed.mean())
    friction = [
        axial_bearing.friction(axial_bearing.Input(0.0, share * speed), par.bearing)
        for share in (0.9, 1.1)
    ]
    return float((friction[1] - friction[0]) / (0.2 * speed)) + par.motor_1.D_M


def _notes(best: Estimate, orders: tuple[int, ...]) -> tuple[str, ...]:
    turned_by = np.degrees(best["phase"]) / orders[0]
    notes = [f"the zero of the cogging is {-turned_by:.4g} degrees from the encoder's zero"]
    if len(orders) > 1:
        notes.append(
            f"the data also contain the orders {', '.join(map(str, orders[1:]))}. The model has "
            f"only the strongest order ({orders[0]})"
        )
    return tuple(notes)


def _turning(data: xr.Dataset, par: WedgeParameters, options: Options) -> Turning:
    """Return the torque of the turning shaft, thinned to independent samples."""
    interval = even_interval(data["time"].values)
    seen = xr.Dataset({"theta": data["q_1"], "i": data["i_1"]})
    moved = differentiated(seen, "theta", ("omega", "alpha"), options.cutoff)
    J = par.motor_1.J_M + par.rig.J_dummy
    K_T = servo_motor.torque_constant(par.motor_1)
    torque = K_T * moved["i"].values - J * moved["alpha"].values
    omega = moved["omega"].values
    every = max(int(_THINNED / (2.0 * options.cutoff * interval)), 1)
    strokes = windows(omega, interval, options.slowest, options.margin, every * interval)
    if not strokes:
        raise ParameterError(
            f"the shaft (q_1) never turns faster than {options.slowest:g} rad/s. {_ADVICE}",
            name="q_1",
            valid=f"{options.slowest:g} rad/s",
        )
    rows = np.array([w.rows.start for w in strokes])
    ways = np.sign(omega[rows])
    if np.all(ways > 0) or np.all(ways < 0):
        raise ParameterError(
            "the shaft (q_1) turns in one direction only, so the data do not separate dry "
            f"friction from a current offset. {_ADVICE}",
            name="q_1",
        )
    fastest = float(np.abs(omega[rows]).max())
    passes = 2.0 * np.pi * options.cutoff / fastest
    if options.highest > passes:
        advice = (
            f"the highest order that a low-pass filter of {options.cutoff:g} Hz passes at "
            f"{fastest:.3g} rad/s. Turn the shaft more slowly, or raise options.cutoff"
        )
        raise not_valid("options.highest", str(options.highest), f"<= {passes:.0f}", advice)
    angle = data["q_1"].values

    def passed(values: Array) -> Array:
        return np.asarray(low_passed(values, interval, options.cutoff)[rows])

    return Turning(
        moved["theta"].values[rows],
        ways,
        np.abs(omega[rows]),
        torque[rows],
        lambda n: (passed(np.cos(n * angle)), passed(np.sin(n * angle))),
    )


def _folded(cogging: CoggingFit) -> Curve:
    """Return torque without friction versus one period of the main order, both directions."""
    turning, order = cogging.turning, cogging.orders[0]
    x = np.mod(order * turning.angle, 2.0 * np.pi)
    middle = (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
    bins = np.minimum((x / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
    rest = turning.torque - cogging.friction
    table = np.full((2, _BINS), np.nan)
    for k, way in enumerate((1.0, -1.0)):
        for b in range(_BINS):
            in_bin = rest[(bins == b) & (turning.way == way)]
            table[k, b] = in_bin.mean() if in_bin.size else np.nan
    amplitude, phase = cogging.estimate["motor_1.T_cog"], cogging.estimate["phase"]
    model = np.tile(amplitude * np.sin(middle + phase), (2, 1))
    return Curve(
        "cogging-period",
        f"Torque without friction over one period of order {order}, measured in both directions "
        "and modeled.",
        over(
            ("x", middle, "rad", f"{order} times the shaft angle"),
            {"measured": table, "modeled": model},
            "N*m",
            "motor torque minus friction",
            ("direction", ("forward", "backward")),
        ),
        "x",
    )


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the simulated slow rotation from a random angle, with sensor noise."""
    experiment = slow_rotation.EXPERIMENT
    case = experiment.cases(par, experiment.defaults, None)[0]
    random = np.random.default_rng(seed)
    sensors = {"i_1": Sensor("i_1", options.sigma_i), "q_1": Sensor("q_1")}
    return sensed(turned(case, random.uniform(0.0, 2.0 * np.pi)), sensors, random)


def truth(par: WedgeParameters, options: Options) -> dict[str, float]:
    """Return the true phase and friction of ``synthetic``."""
    speed = slow_rotation.EXPERIMENT.defaults.omega_slow  # type: ignore[attr-defined]
    bearing = axial_bearing.friction(axial_bearing.Input(0.0, speed), par.bearing)
    friction = float(bearing) + par.motor_1.D_M * speed
    return {"phase": 0.0, "T_forward": friction, "T_backward": friction}


METHOD = Method(
    name="cogging",
    assembly="wedge-brake",
    summary="cogging torque (orders, amplitudes, phases) and dry friction",
    experiment="slow-rotation",
    signals={"i_1": "A", "q_1": "rad"},
    options=Options,
    defaults=Options(cutoff=60.0, slowest=0.1, margin=0.3, highest=400, sigma_i=0.02),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_i",),
    unknowns=("motor_1.T_cog",),
    truth=truth,
    further={
        "phase": ("rad", "phase of the main order at the encoder's zero"),
        "amplitude.N": ("N*m", "amplitude of a weaker order N, whose phase is phase.N"),
        "T_forward": ("N*m", "dry friction forward"),
        "T_backward": ("N*m", "dry friction backward"),
        "friction_slope": ("N*m*s/rad", "slope of friction versus speed, at the test speed"),
    },
)
