"""Current over the force of a screw drive: a mean line, and friction to either side of it.

Two motors squeeze a force between their screws; one of them at rest is the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.wedge.methods.drive_train.cogging_waves import waves
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.differentiation import low_passed
from bywire.identification.equation import windows
from bywire.identification.measured import wrong_sign
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown
from bywire.plant import axial_bearing, roller_screw, servo_motor

MEANINGS: Mapping[str, tuple[str, str]] = {
    "offset": ("A", "current at zero force, i_0"),
    "force_per_current": ("N/A", "slope of the line, c"),
    "half_width": ("A", "friction to either side without force, w_0"),
    "half_width_slope": ("A/N", "its growth with force, w_1"),
    "half_width_curvature": ("A/N**2", "and with the square of force, w_2"),
}
"""unknowns of the law -> SI unit and meaning"""

NAMES = tuple(MEANINGS)
_AGAINST = -0.5  # correlation of current and force: beyond chance


@dataclass(frozen=True)
class Squeeze:
    """Steady motion of two screws toward each other or apart, by window, shapes (n,).

    Parameters
    ----------
    i
        Current that squeezes, mean of both motors, at the stated speed [A].
    F
        Force by the sensor, the lag of its amplifier allowed for, compression positive [N].
    d
        How much closer the encoders say the nuts are [m].
    way
        1 closing, -1 opening.
    waves
        Of the cogging, shape (n, 4).
    reach
        The travel one margin before a window begins, and at its end [m], shape (n, 2): what
        happens in between shows in the window.
    each
        Speed of one motor in each window [rad/s].
    speed
        Of one motor, that the current is stated at [rad/s].
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
        """Return the same with forces that no sensor told, and the current stated anew for them."""
        before = _speed_effect(self.F, self.each, self.speed, par)
        after = _speed_effect(F, self.each, self.speed, par)
        return replace(self, i=self.i + self.way * (before - after), F=F)


@dataclass(frozen=True)
class Reading:
    """How a record is read.

    Parameters
    ----------
    cutoff
        Low-pass of the speed [Hz].
    slowest, margin, length
        Of the closing speed [rad/s], and times [s]; see
        :func:`bywire.identification.equation.windows`.
    speed
        Of one motor, that the current is stated at [rad/s]; the record's mean by default.
    """

    cutoff: float
    slowest: float
    margin: float
    length: float
    speed: float | None = None


def squeeze(data: xr.Dataset, par: WedgeParameters, reading: Reading, where: str) -> Squeeze:
    """Return the steady motions of a record.

    ``data``: ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad], ``y_F`` [N]; ``par``: lead of the screw,
    order of the cogging, corner of the force sensor, and how the friction of bearings and motors
    changes with speed; ``reading``: how it is read; ``where``: what the record is, for messages.

    Raises
    ------
    ParameterError
        When the motors do not move both ways, or their currents go against the force.
    """
    interval = even_interval(data["time"].values)
    q_1, q_2 = data["q_1"].values, data["q_2"].values
    speed = np.gradient(low_passed(q_1 - q_2, interval, reading.cutoff), interval)
    steady = windows(speed, interval, reading.slowest, reading.margin, reading.length)
    side = np.sign(low_passed(data["y_F"].values, interval, reading.cutoff))
    # Where the force changes its sign, friction has a kink, and a mean over it is none of the law.
    steady = [w for w in steady if abs(float(side[w.rows].mean())) in (0.0, 1.0)]
    ways = np.array([np.sign(speed[w.rows].mean()) for w in steady])
    if not (np.any(ways > 0) and np.any(ways < 0)):
        raise ParameterError(
            f"{where}: the screws do not move both toward each other and apart at more than "
            f"{reading.slowest:g} rad/s: the friction cannot be told from the force; squeeze and "
            "let go slowly, as 'bywire run force-cycle' does"
        )

    def means(values: Array) -> Array:
        return np.array([values[w.rows].mean(axis=0) for w in steady])

    # The sensor's amplifier lags, one way while the force rises, the other while it falls.
    lag = 1.0 / (2.0 * np.pi * par.rig.sensor.f_F)
    rate = np.gradient(low_passed(data["y_F"].values, interval, reading.cutoff), interval)
    F = means(data["y_F"].values + lag * rate)
    i = means(0.5 * (data["i_1"].values - data["i_2"].values))
    _require_along(i, F, where)
    each = 0.5 * np.abs(means(speed))
    stated = float(each.mean()) if reading.speed is None else reading.speed
    beyond = _speed_effect(F, each, stated, par)
    d = roller_screw.slope(par.screw) * (q_1 - q_2)
    skip = round(reading.margin / interval)
    return Squeeze(
        i=i - ways * beyond,
        F=F,
        d=means(d),
        way=ways,
        waves=means(waves(q_1, q_2, par.motor_1.N_cog)),
        reach=np.array([(d[w.rows.start - skip], d[w.rows.stop - 1]) for w in steady]),
        each=each,
        speed=stated,
    )


def _require_along(i: Array, F: Array, where: str) -> None:
    """Refuse currents that pull apart where the sensor shows compression."""
    together = float(np.corrcoef(i, F)[0, 1]) if np.ptp(F) > 0.0 and np.ptp(i) > 0.0 else 0.0
    if together < _AGAINST:
        raise wrong_sign(
            f"i_1 - i_2 of {where}", "y_F", f"correlation {together:.2f}, compression positive"
        )


def _speed_effect(F: Array, speed: Array, stated: float, par: WedgeParameters) -> Array:
    """Return the current by which friction at each speed exceeds that at the stated one [A].

    A position loop gives way under load, so that the screws close slower than they open; the
    friction of bearings and motors changes with the speed, and the line would turn by it.
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


def unknowns(par: WedgeParameters) -> tuple[Unknown, ...]:
    r"""Return the unknowns of the law, started where the parameter set says.

    .. math::
        i = i_0 + F/c \pm (w_0 + w_1 |F| + w_2 F^2), \quad
        \frac{1}{c} = \frac{L}{2\pi} \frac{1/\eta_f + \eta_b}{2 K_T}, \quad
        w_1 = \frac{L}{2\pi} \frac{1/\eta_f - \eta_b}{2 K_T} + \frac{C_1}{K_T}

    with :math:`w_0 = C_0 (1 + G_S) / K_T` and :math:`w_2 = C_2 / K_T` of the bearings' friction.
    """
    K = 0.5 * sum(servo_motor.torque_constant(m) for m in (par.motor_1, par.motor_2))
    k, screw, bearing = roller_screw.slope(par.screw), par.screw, par.bearing
    c = 2.0 * K / (k * (1.0 / screw.eta_f + screw.eta_b))
    half = bearing.C_0 * (1.0 + bearing.G_S) / K
    slope = 0.5 * k * (1.0 / screw.eta_f - screw.eta_b) / K + bearing.C_1 / K
    curvature = bearing.C_2 / K
    return (
        Unknown(NAMES[0], 0.0, scale=half, unit="A"),
        Unknown(NAMES[1], c, low=1e-3 * c, high=1e3 * c, scale=c, unit="N/A"),
        Unknown(NAMES[2], half, scale=half, unit="A"),
        Unknown(NAMES[3], slope, scale=max(slope, 0.1 / c), unit="A/N"),
        Unknown(NAMES[4], curvature, scale=max(curvature, 1e-4 / c), unit="A/N**2"),
    )


def law(F: Array, way: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return the current, its derivatives by the unknowns (n, 5), and by the force (n,)."""
    c = values[1]
    size = np.abs(F)
    columns = np.column_stack((np.ones_like(F), -F / c**2, way, way * size, way * size**2))
    w_0, w_1, w_2 = values[2:5]
    i = values[0] + F / c + way * (w_0 + w_1 * size + w_2 * size**2)
    return i, columns, 1.0 / c + way * np.sign(F) * (w_1 + 2.0 * w_2 * size)


def branches(squeezed: Squeeze, power: int, x: Array) -> Array:
    """Return polynomials over x of their own for closing and opening, below, at and above zero."""
    scaled = x / max(float(np.abs(x).max()), 1e-300)
    groups = [
        (squeezed.way == way) & (np.sign(x) == side) for way in (1, -1) for side in (1, 0, -1)
    ]
    of_groups = [g[:, None] * np.vander(scaled, power + 1) for g in groups if g.any()]
    return np.hstack(of_groups)
