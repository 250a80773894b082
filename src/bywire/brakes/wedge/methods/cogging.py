"""Cogging torque of a motor from slow rotation both ways (Roberts 2003, section "Motor").

Cogging depends on the angle and is the same both ways; dry friction changes its sign.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.brakes.wedge.experiments import slow_rotation
from bywire.brakes.wedge.methods.drive_train.cogging_fit import (
    CoggingFit,
    Turning,
    cogging_problem,
    same_both_ways,
    slope_as_known,
    standing_out,
)
from bywire.brakes.wedge.methods.turned import turned
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.differentiation import differentiated, low_passed
from bywire.identification.equation import windows
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import estimate
from bywire.identification.measured import wrong_sign
from bywire.identification.method import Curve, Effort, Identified, Method
from bywire.identification.output_error import even_interval
from bywire.identification.sensed import Sensor, sensed
from bywire.plant import axial_bearing, servo_motor
from bywire.plant.axial_bearing import AngularSpeed

_ADVICE = "turn the shaft slowly by whole revolutions both ways, as 'bywire run slow-rotation' does"
_BINS = 36
_THINNED = 0.8  # of half the new sample rate: what the low-pass lets pass


class Options(ParameterSet):
    """How the signals are filtered, which orders are looked for, and the synthetic noise."""

    cutoff: Frequency
    """low-pass of torque and angle; cogging has to pass it"""
    slowest: AngularSpeed
    """speed below which the shaft counts as turning round"""
    margin: Duration
    """time left out at either end of a motion"""
    highest: Annotated[int, Unit("1", 400.0), Field(ge=1, le=10000)]
    """highest order of a revolution that is looked for"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """noise of the measured current in synthetic measurements"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return amplitude and phase of the cogging torque's orders, and the friction both ways.

    .. math::
        K_T i - J \dot\omega = \sum_n T_n \sin(n \theta + \varphi_n)
        \pm T_{FRICT} + d\,(\omega \mp \bar\omega)

    The last term is what friction changes with the ripple of the speed.

    Parameters
    ----------
    data
        ``i_1`` [A], ``q_1`` [rad]. Torque constant and inertia, the
        dummy shaft's included, are known.

    Raises
    ------
    ParameterError
        When the shaft turns one way only, too little, no order stands out, or a sign is wrong.

    References
    ----------
    Roberts et al. (2003), section "Motor": T_COG(theta).
    """
    turning = _turning(data, par, options)
    _require_braking(turning)
    orders = standing_out(turning.angle, turning.leveled, options.highest)
    if not orders:
        raise ParameterError(
            f"no order up to {options.highest} stands out of the noise: turn slower or by more "
            "revolutions, or raise options.highest"
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
        checks=(same_both_ways(cogging), slope_as_known(cogging, _slope(par, turning))),
        curves=(_folded(cogging),),
        notes=_notes(best, orders),
    )


def _require_braking(turning: Turning) -> None:
    """Refuse a motor that the friction drives: it has to push the shaft both ways."""
    forward, backward = (float(turning.torque[turning.way == w].mean()) for w in (1.0, -1.0))
    friction = 0.5 * (forward - backward)
    if friction < 0.0:
        raise wrong_sign("i_1", "q_1", f"friction {friction:.3g} N*m: it would drive the shaft")


def _slope(par: WedgeParameters, turning: Turning) -> float:
    """Return the slope of the known friction over the speed at the test's."""
    speed = float(turning.speed.mean())
    beside = [
        axial_bearing.friction(axial_bearing.Input(0.0, share * speed), par.bearing)
        for share in (0.9, 1.1)
    ]
    return float((beside[1] - beside[0]) / (0.2 * speed)) + par.motor_1.D_M


def _notes(best: Estimate, orders: tuple[int, ...]) -> tuple[str, ...]:
    turned_by = np.degrees(best["phase"]) / orders[0]
    notes = [f"the cogging's zero lies {-turned_by:.4g} degrees of shaft angle from the encoder's"]
    if len(orders) > 1:
        notes.append(
            f"orders {', '.join(map(str, orders[1:]))} show as well; the model has one, the "
            f"strongest ({orders[0]})"
        )
    return tuple(notes)


def _turning(data: xr.Dataset, par: WedgeParameters, options: Options) -> Turning:
    """Return the shaft's torque while it turns, thinned to independent samples."""
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
            f"the shaft never turns faster than {options.slowest:g} rad/s: {_ADVICE}"
        )
    rows = np.array([w.rows.start for w in strokes])
    ways = np.sign(omega[rows])
    if np.all(ways > 0) or np.all(ways < 0):
        raise ParameterError(
            "the shaft turns one way only: dry friction and an offset of the current cannot be "
            f"told apart; {_ADVICE}"
        )
    fastest = float(np.abs(omega[rows]).max())
    passes = 2.0 * np.pi * options.cutoff / fastest
    if options.highest > passes:
        raise ParameterError(
            f"options.highest = {options.highest} is not admissible: at {fastest:.3g} rad/s the "
            f"low-pass of {options.cutoff:g} Hz lets orders up to {passes:.0f} pass; turn slower, "
            "raise options.cutoff, or ask for lower orders"
        )
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
    """Return torque over one period of the main order, friction taken off, both ways."""
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
        f"Torque over one period of order {order} without friction: measured both ways, modeled.",
        over(
            ("x", middle, "rad", f"{order} times the shaft angle"),
            {"measured": table, "modeled": model},
            "N*m",
            "torque against cogging",
            ("direction", ("forward", "backward")),
        ),
        "x",
    )


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the slow rotation, simulated, with the sensor's noise, from any angle."""
    experiment = slow_rotation.EXPERIMENT
    case = experiment.cases(par, experiment.defaults, None)[0]
    random = np.random.default_rng(seed)
    sensors = {"i_1": Sensor("i_1", options.sigma_i), "q_1": Sensor("q_1")}
    return sensed(turned(case, random.uniform(0.0, 2.0 * np.pi)), sensors, random)


def truth(par: WedgeParameters, options: Options) -> dict[str, float]:
    """Return phase and friction that ``synthetic`` puts in."""
    speed = slow_rotation.EXPERIMENT.defaults.omega_slow  # type: ignore[attr-defined]
    bearing = axial_bearing.friction(axial_bearing.Input(0.0, speed), par.bearing)
    friction = float(bearing) + par.motor_1.D_M * speed
    return {"phase": 0.0, "T_forward": friction, "T_backward": friction}


METHOD = Method(
    name="cogging",
    assembly="wedge-brake",
    summary="orders of the cogging torque, amplitude and phase, and dry friction apart from them",
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
        "phase": ("rad", "of the main order at the encoder's zero"),
        "amplitude.N": ("N*m", "of a weaker order N, with its phase.N"),
        "T_forward": ("N*m", "dry friction forward"),
        "T_backward": ("N*m", "dry friction backward"),
        "friction_slope": ("N*m*s/rad", "friction over speed, at the test's"),
    },
)
