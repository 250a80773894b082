"""Force versus current of a screw drive: calibration line, friction band, offset.

A brake without a force sensor needs the force at a given current, and its uncertainty due to
friction. Two motors squeeze a force between their screws. One of the motors may be at rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.brakes.wedge.case import turned
from bywire.brakes.wedge.experiments.stiffness import FORCE_CYCLE
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array
from bywire.data.labeled import at_own_places, over
from bywire.identification.differentiation import low_passed
from bywire.identification.equation import windows
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import wrong_sign
from bywire.identification.method import Curve, Effort, Identified, Method
from bywire.identification.output_error import even_interval
from bywire.identification.residuals import lack_of_fit
from bywire.identification.trust import Sensor, sensed
from bywire.identification.unknown import Unknown
from bywire.plant import axial_bearing, roller_screw, servo_motor
from bywire.plant.axial_bearing import AngularSpeed

if TYPE_CHECKING:
    import xarray as xr

SIGNALS: Mapping[str, str] = {"i_1": "A", "i_2": "A", "q_1": "rad", "q_2": "rad", "y_F": "N"}
"""currents, angles, compressive force: name -> SI unit"""

SIMULATED = ("sigma_i", "sigma_F")
"""options that only synthetic measurements use"""


class RigOptions(ParameterSet):
    """Part of the motion that counts, and the synthetic noise."""

    cutoff: Frequency
    """cutoff frequency of the low-pass filter for the speed"""
    slowest: AngularSpeed
    """relative speed of the two motors above which they are considered moving"""
    margin: Duration
    """time to omit at the start and end of each motion"""
    window: Duration
    """averaging time for the signals"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """current noise in synthetic measurements"""
    sigma_F: Annotated[float, Unit("N", 5.0), Field(ge=0)]
    """force sensor noise in synthetic measurements"""


def drive_sensors(options: RigOptions) -> dict[str, Sensor]:
    """Return the sensors of a synthetic measurement: currents, shaft angles, force."""
    sensors = {name: Sensor(name, options.sigma_i) for name in ("i_1", "i_2")}
    sensors |= {name: Sensor(name) for name in ("q_1", "q_2")}
    return sensors | {"y_F": Sensor("y_F", options.sigma_F)}


# --- Cogging of two motors that squeeze a force between their screws

_WAVES = {
    "cos": "cogging of known order versus the relative angle of the motors, cosine coefficient",
    "sin": "cogging of known order versus the relative angle of the motors, sine coefficient",
    "cos_drift": "effect of both motors drifting in the same direction, cosine coefficient",
    "sin_drift": "effect of both motors drifting in the same direction, sine coefficient",
}


def cogging_waves(q_1: Array, q_2: Array, order: float) -> Array:
    r"""Return the waves that cogging causes in the squeezing current, shape (n, 4).

    .. math::
        \{\cos\psi, \sin\psi\} \times \{\cos\delta, \sin\delta\}, \qquad
        \psi = N \frac{q_1 - q_2}{2}, \quad \delta = N \frac{q_1 + q_2}{2}

    where :math:`\delta` has its mean subtracted. Every :math:`a \cos(N q_1 + \varphi_1) +
    b \cos(N q_2 + \varphi_2)` is a sum of these waves. The motors turn in opposite directions, so
    :math:`\delta` is only the common motion that cogging causes. Without this motion its waves
    vanish.

    If one motor is at rest, its cogging is part of the offset and not a wave. The result is then
    the waves of the other motor, and zeros.

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


def cogging_unknowns(par: WedgeParameters, stage: str) -> tuple[Unknown, ...]:
    """Return the unknown amplitudes of the waves in the current of a stage."""
    K = servo_motor.torque_constant(par.motor_1)
    size = max(par.motor_1.T_cog, par.motor_2.T_cog, 1e-4) / K
    return tuple(
        Unknown(name, 0.0, scale=10.0 * size, unit=unit)
        for name, (unit, _) in cogging_meanings(stage).items()
    )


def cogging_meanings(stage: str) -> dict[str, tuple[str, str]]:
    """Return SI unit and meaning of each unknown of a stage, by name."""
    return {f"cogging.{stage}.{name}": ("A", text) for name, text in _WAVES.items()}


# --- Current versus force: a mean line, and friction to either side of it

LAW_MEANINGS: Mapping[str, tuple[str, str]] = {
    "offset": ("A", "current at zero force, i_0"),
    "force_per_current": ("N/A", "slope of the line, c"),
    "half_width": ("A", "half-width of the friction band at zero force, w_0"),
    "half_width_slope": ("A/N", "growth of the half-width with force, w_1"),
    "half_width_curvature": ("A/N**2", "growth of the half-width with force squared, w_2"),
}
"""unknowns of the law -> SI unit and meaning"""

LAW_NAMES = tuple(LAW_MEANINGS)
_AGAINST = -0.5  # a correlation of current and force below this is not by chance


@dataclass(frozen=True)
class Squeeze:
    """Steady motion of two screws toward each other or apart, one value per window, shapes (n,).

    Parameters
    ----------
    i
        Squeezing current, mean of both motors, at the reference speed [A].
    F
        Force from the sensor, corrected for the amplifier lag, positive in compression [N].
    d
        Approach of the nuts from the encoders [m].
    way
        1 closing, -1 opening.
    waves
        Waves of the cogging, shape (n, 4).
    reach
        Travel one margin before a window begins, and at its end [m], shape (n, 2). Events in
        between affect the window.
    each
        Speed of one motor in each window [rad/s].
    speed
        Reference speed of one motor [rad/s]. The current is corrected to this speed.
    """

    i: Array
    F: Array
    d: Array
    way: Array
    waves: Array
    reach: Array
    each: Array
    speed: float

    def only(self, rows: NDArray[np.bool_]) -> Squeeze:
        """Return some of the windows."""
        columns = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "speed"}
        return replace(self, **columns)

    def under(self, F: Array, par: WedgeParameters) -> Squeeze:
        """Return the same motion with other forces, and the current corrected for them."""
        before = _speed_effect(self.F, self.each, self.speed, par)
        after = _speed_effect(F, self.each, self.speed, par)
        return replace(self, i=self.i + self.way * (before - after), F=F)


def squeeze(
    data: xr.Dataset,
    par: WedgeParameters,
    options: RigOptions,
    where: str,
    reference_speed: float | None = None,
) -> Squeeze:
    """Return the steady motions in a record.

    Parameters
    ----------
    data
        ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad], ``y_F`` [N].
    par
        Screw lead, cogging order, cutoff frequency of the force sensor, and the change of bearing
        and motor friction with speed.
    options
        Filter and windows.
    where
        Name of the record in messages.
    reference_speed
        Speed of one motor [rad/s] to which the current is corrected. Default: the record's mean.

    Raises
    ------
    ParameterError
        If the motors do not move in both directions, or if their currents oppose the force.
    """
    interval = even_interval(data["time"].values)
    q_1, q_2 = data["q_1"].values, data["q_2"].values
    speed = np.gradient(low_passed(q_1 - q_2, interval, options.cutoff), interval)
    steady = windows(speed, interval, options.slowest, options.margin, options.window)
    side = np.sign(low_passed(data["y_F"].values, interval, options.cutoff))
    # Friction has a kink where the force changes sign, and a mean over the kink violates the law.
    steady = [w for w in steady if abs(float(side[w.rows].mean())) in (0.0, 1.0)]
    ways = np.array([np.sign(speed[w.rows].mean()) for w in steady])
    if not (np.any(ways > 0) and np.any(ways < 0)):
        raise ParameterError(
            f"{where}: the screws do not move both toward each other and apart at more than "
            f"{options.slowest:g} rad/s, so the data do not separate friction from force. "
            "Squeeze and release slowly, as 'bywire run force-cycle' does",
            name=where,
        )

    def means(values: Array) -> Array:
        return np.array([values[w.rows].mean(axis=0) for w in steady])

    # The sensor's amplifier lags: it reads too low while the force rises, and too high while it
    # falls.
    lag = 1.0 / (2.0 * np.pi * par.rig.sensor.f_F)
    rate = np.gradient(low_passed(data["y_F"].values, interval, options.cutoff), interval)
    F = means(data["y_F"].values + lag * rate)
    i = means(0.5 * (data["i_1"].values - data["i_2"].values))
    _require_along(i, F, where)
    each = 0.5 * np.abs(means(speed))
    stated = float(each.mean()) if reference_speed is None else reference_speed
    beyond = _speed_effect(F, each, stated, par)
    d = roller_screw.slope(par.screw) * (q_1 - q_2)
    skip = round(options.margin / interval)
    return Squeeze(
        i=i - ways * beyond,
        F=F,
        d=means(d),
        way=ways,
        waves=means(cogging_waves(q_1, q_2, par.motor_1.N_cog)),
        reach=np.array([(d[w.rows.start - skip], d[w.rows.stop - 1]) for w in steady]),
        each=each,
        speed=stated,
    )


def _require_along(i: Array, F: Array, where: str) -> None:
    """Require currents that squeeze while the sensor shows compression."""
    together = float(np.corrcoef(i, F)[0, 1]) if np.ptp(F) > 0.0 and np.ptp(i) > 0.0 else 0.0
    if together < _AGAINST:
        raise wrong_sign(
            f"i_1 - i_2 of {where}", "y_F", f"correlation {together:.2f}, compression positive"
        )


def _speed_effect(F: Array, speed: Array, stated: float, par: WedgeParameters) -> Array:
    """Return the extra current that friction needs at each speed, relative to the reference [A].

    A position loop yields under load, so the screws close more slowly than they open. The friction
    of bearings and motors changes with speed, which would tilt the line.
    """
    motor = par.motor_1
    bearing = np.array(
        [
            axial_bearing.friction(axial_bearing.Input(float(f), float(w)), par.bearing)
            - axial_bearing.friction(axial_bearing.Input(float(f), stated), par.bearing)
            for f, w in zip(F, speed, strict=True)
        ]
    )
    return (bearing + motor.D_M * (speed - stated)) / servo_motor.torque_constant(motor)


def law_unknowns(par: WedgeParameters) -> tuple[Unknown, ...]:
    r"""Return the unknowns of the law, with starting values from the parameter set.

    .. math::
        i = i_0 + F/c \pm (w_0 + w_1 |F| + w_2 F^2), \quad
        \frac{1}{c} = \frac{L}{2\pi} \frac{1/\eta_f + \eta_b}{2 K_T}, \quad
        w_1 = \frac{L}{2\pi} \frac{1/\eta_f - \eta_b}{2 K_T} + \frac{C_1}{K_T}

    with :math:`w_0 = C_0 (1 + G_S) / K_T` and :math:`w_2 = C_2 / K_T` from the bearing friction.
    """
    K = 0.5 * sum(servo_motor.torque_constant(m) for m in (par.motor_1, par.motor_2))
    k, screw, bearing = roller_screw.slope(par.screw), par.screw, par.bearing
    c = 2.0 * K / (k * (1.0 / screw.eta_f + screw.eta_b))
    half = bearing.C_0 * (1.0 + bearing.G_S) / K
    slope = 0.5 * k * (1.0 / screw.eta_f - screw.eta_b) / K + bearing.C_1 / K
    curvature = bearing.C_2 / K
    return (
        Unknown(LAW_NAMES[0], 0.0, scale=half, unit="A"),
        Unknown(LAW_NAMES[1], c, low=1e-3 * c, high=1e3 * c, scale=c, unit="N/A"),
        Unknown(LAW_NAMES[2], half, scale=half, unit="A"),
        Unknown(LAW_NAMES[3], slope, scale=max(slope, 0.1 / c), unit="A/N"),
        Unknown(LAW_NAMES[4], curvature, scale=max(curvature, 1e-4 / c), unit="A/N**2"),
    )


def law(F: Array, way: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return the current and its derivatives, by the unknowns (n, 5) and by the force (n,)."""
    c = values[1]
    size = np.abs(F)
    columns = np.column_stack((np.ones_like(F), -F / c**2, way, way * size, way * size**2))
    w_0, w_1, w_2 = values[2:5]
    i = values[0] + F / c + way * (w_0 + w_1 * size + w_2 * size**2)
    return i, columns, 1.0 / c + way * np.sign(F) * (w_1 + 2.0 * w_2 * size)


def branches(squeezed: Squeeze, power: int, x: Array) -> Array:
    """Return separate polynomials of x for closing and opening, below, at and above zero."""
    scaled = x / max(float(np.abs(x).max()), 1e-300)
    groups = [
        (squeezed.way == way) & (np.sign(x) == side) for way in (1, -1) for side in (1, 0, -1)
    ]
    of_groups = [g[:, None] * np.vander(scaled, power + 1) for g in groups if g.any()]
    return np.hstack(of_groups)


# --- The method

_GAP = np.full((2, 1), np.nan)
_LAW = len(LAW_NAMES)


def identify(
    data: xr.Dataset, par: WedgeParameters, options: RigOptions, effort: Effort
) -> Identified:
    r"""Return the line of force versus current and the friction around it.

    .. math:: i = i_0 + F/c \pm (w_0 + w_1 |F| + w_2 F^2)

    The upper sign applies while the screws close. The same fit includes cogging of known order.

    Parameters
    ----------
    data
        ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad], ``y_F`` [N] of two motors that squeeze and
        release slowly. A motor that only holds may be at rest.

    Raises
    ------
    ParameterError
        If the motors move in one direction only.

    References
    ----------
    Roberts et al. (2003), section "Rollerscrew and bearings": loss of the screw, bearing friction.
    """
    cycle = squeeze(data, par, options, "the record")
    unknowns = law_unknowns(par) + cogging_unknowns(par, "sensor")
    scatter = _scatter(cycle)

    def evaluate(values: Array) -> tuple[Array, Array]:
        i, columns, _ = law(cycle.F, cycle.way, values)
        e = i + cycle.waves @ values[_LAW:] - cycle.i
        return e / scatter, np.hstack((columns, cycle.waves)) / scatter

    best = estimate(Problem(unknowns, evaluate))
    estimates = {u.label: u.start for u in unknowns} | dict(
        zip(best.names, best.values, strict=True)
    )
    values = np.array([estimates[u.label] for u in unknowns])
    return Identified(
        estimates={"force versus current": best},
        parameters={},
        figures=_figures(values, cycle, par),
        checks=(
            lack_of_fit(
                "current_left_over",
                evaluate(values)[0],
                np.ones(cycle.i.size),
                np.hstack((branches(cycle, 3, cycle.F), cycle.waves)),
                len(best.values),
                "whether current versus force deviates from the law",
            ),
        ),
        curves=(_curve(cycle, values),),
        notes=(
            "half-widths are valid at the mean speed of the test. At rest the force may be "
            "anywhere within them",
            "the change of bearing friction with speed comes from the parameter set",
        ),
    )


def _scatter(cycle: Squeeze) -> float:
    """Return a rough scatter of the current. It has no influence on the result."""
    return max(float(np.median(np.abs(np.diff(cycle.i)))), 1e-9)


def _figures(values: Array, cycle: Squeeze, par: WedgeParameters) -> dict[str, tuple[float, str]]:
    K = 0.5 * sum(servo_motor.torque_constant(m) for m in (par.motor_1, par.motor_2))
    per = K / roller_screw.slope(par.screw)
    top = float(np.abs(cycle.F).max())
    half = float(values[2] + values[3] * top + values[4] * top**2)
    return {
        "force_per_current": (float(values[1]), "N/A"),
        "largest_force": (top, "N"),
        "half_width_at_largest_force": (half, "A"),
        "eta_f": (float(1.0 / (per * (1.0 / values[1] + values[3]))), "1"),
        "eta_b": (float(per * (1.0 / values[1] - values[3])), "1"),
    }


def _curve(cycle: Squeeze, values: Array) -> Curve:
    measured = cycle.i - cycle.waves @ values[_LAW:]
    places, rows = [], []
    for sign in (1.0, -1.0):
        F, i = cycle.F[cycle.way == sign], measured[cycle.way == sign]
        # Leave a gap at zero force, because no window lies at the kink there.
        places.append(np.append(F, 0.0))
        branch = np.array((i, law(F, np.full(F.size, sign), values)[0]))
        rows.append(np.append(branch, _GAP, axis=1))
    line = np.array((cycle.F.min(), 0.0, cycle.F.max()))
    places.append(line)
    rows.append(np.array((np.full(3, np.nan), law(line, np.zeros(3), values)[0])))
    F, table = at_own_places(places, rows)
    return Curve(
        "current-over-force",
        "Current versus force, closing and opening, with the calibration line in the middle.",
        over(
            ("F", F, "N", "force"),
            {"measured": table[0], "modeled": table[1]},
            "A",
            "current without cogging",
            ("direction", ("closing", "opening", "mean line")),
        ),
        "F",
    )


def synthetic(par: WedgeParameters, options: RigOptions, seed: int) -> xr.Dataset:
    """Return the simulated force cycle on the sensor, with sensor noise."""
    case = FORCE_CYCLE.cases(par, FORCE_CYCLE.defaults, None)[0]
    random = np.random.default_rng(seed)
    begun = turned(case, random.uniform(0.0, 2.0 * np.pi))
    return sensed(begun, drive_sensors(options), random)


def truth(par: WedgeParameters, options: RigOptions) -> dict[str, float]:
    """Return the true line and friction growth according to the laws of screw and bearing."""
    known = {u.label: u.start for u in law_unknowns(par)}
    return {name: known[name] for name in ("offset", "force_per_current", "half_width_slope")}


METHOD = Method(
    name="force-calibration",
    assembly="wedge-brake",
    summary="force versus current of the screw drive: calibration line, friction band, offset",
    experiment="force-cycle",
    signals=SIGNALS,
    options=RigOptions,
    defaults=RigOptions(
        cutoff=20.0, slowest=0.2, margin=0.05, window=0.02, sigma_i=0.02, sigma_F=5.0
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=SIMULATED,
    truth=truth,
    further={**LAW_MEANINGS, **cogging_meanings("sensor")},
)
