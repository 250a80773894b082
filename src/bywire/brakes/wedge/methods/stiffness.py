"""Stiffnesses and free play of the drive train from the two-stage test (Roberts 2003).

First the screws squeeze and pull a force sensor. This stage gives the screw stiffness and the force
per current. Then the screws work in the brake heart, where the current gives the force. They press
tip to tip while they close, pull on the wedge while they open, and are free in between.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.wedge.case import slope_of, turned
from bywire.brakes.wedge.experiments.stiffness import FORCE_CYCLE, LABELS
from bywire.brakes.wedge.methods import force_calibration
from bywire.brakes.wedge.methods.force_calibration import (
    SIGNALS,
    SIMULATED,
    RigOptions,
    Squeeze,
    branches,
    drive_sensors,
    law,
    squeeze,
)
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.equation import steady_dynamics
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem
from bywire.identification.measured import joined, split
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.residuals import lack_of_fit
from bywire.identification.trust import Sensor, sensed
from bywire.identification.unknown import Unknown, parameters_of
from bywire.plant import shaft_encoder

if TYPE_CHECKING:
    import xarray as xr

_STIFFNESS = ("heart.K_S", "heart.K_W", "heart.K_C")
_S, _W, _C, _ZERO, _CLOSED, _PLAY = range(6)
_LAW = slice(6, 11)
_SENSOR, _HEART, _LOOP = slice(11, 15), slice(15, 19), 19
MEANINGS: Mapping[str, tuple[str, str]] = {
    "zero_of_travel": ("m", "travel at which no force acts on the sensor, d_0"),
    "tips_touch": ("m", "travel at which the tips touch, d_c"),
    "free_play": ("m", "travel from that position to the pull on the wedge, d_c - d_t"),
    **force_calibration.LAW_MEANINGS,
    **force_calibration.cogging_meanings("sensor"),
    **force_calibration.cogging_meanings("heart"),
    "travel_loop": ("m", "encoder lag behind the motion, h"),
}
"""unknowns other than the stiffnesses -> SI unit and meaning"""

_SHARE = 0.3  # fraction of the maximum current above which a contact is surely closed


@dataclass(frozen=True)
class Contacts:
    """Approximate travels [m] at which the tips touch (``closed``) and the wedge is pulled."""

    closed: float
    apart: float


def started(par: WedgeParameters, sensor: Squeeze, heart: Squeeze, advice: str) -> Contacts:
    """Return the approximate contacts: zero crossings of lines through the loading data.

    Raises
    ------
    ParameterError
        If the record does not reach one of the contacts.
    """
    values = np.array([u.start for u in force_calibration.law_unknowns(par)])
    friction = values[2]
    unknowns = []
    for way, what in ((1.0, "tip to tip"), (-1.0, "through the wedge")):
        level = way * heart.i
        loading = (heart.way == way) & (level > _SHARE * np.abs(sensor.i).max())
        if int(loading.sum()) < 3 or not np.ptp(heart.d[loading]) > 0.0:
            raise ParameterError(
                f"record heart: the screws do not load each other {what}. Increase the travel. "
                f"{advice}",
                name="record heart",
            )
        slope, start = np.polyfit(heart.d[loading], level[loading], 1)
        unknowns.append(float((friction - start) / slope))
    if not unknowns[0] > unknowns[1]:
        raise ParameterError(
            "record heart: closing and opening load the screws at the same travel. Either they "
            "have no free play, or the signs of the currents are wrong",
            name="record heart",
        )
    return Contacts(*unknowns)


def clear_of(contacts: Contacts, heart: Squeeze) -> NDArray[np.bool_]:
    """Return the windows in which, and just before which, no contact opens or closes.

    Force versus travel has a kink at a contact, and a mean over a window rounds it off. The motors
    also change their speed there.
    """
    low, high = heart.reach.min(axis=1), heart.reach.max(axis=1)
    kinks = np.array([contacts.closed, contacts.apart])
    inside = (low[:, None] <= kinks) & (kinks <= high[:, None])
    return np.asarray(~inside.any(axis=1))


@dataclass(frozen=True)
class TwoStages:
    """Measurements of both stages, and the unknowns of the fit.

    Parameters
    ----------
    par
        Known parameters, including the sensor stiffness, and starting values.
    sensor, heart
        The two stages.
    contacts
        Starting values of the contacts.
    """

    par: WedgeParameters
    sensor: Squeeze
    heart: Squeeze
    contacts: Contacts

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Stiffnesses, zeros of travel, free play, current law, cogging, encoder lag."""
        play = self.contacts.closed - self.contacts.apart
        return (
            *parameters_of(self.par, _STIFFNESS),
            Unknown("zero_of_travel", float(np.mean(self.sensor.d)), scale=play, unit="m"),
            Unknown("tips_touch", self.contacts.closed, scale=play, unit="m"),
            Unknown("free_play", play, low=0.0, scale=play, unit="m"),
            *force_calibration.law_unknowns(self.par),
            *force_calibration.cogging_unknowns(self.par, "sensor"),
            *force_calibration.cogging_unknowns(self.par, "heart"),
            Unknown("travel_loop", 0.0, scale=1e-3 * play, unit="m"),
        )

    def parts(self) -> tuple[Problem, Problem, Problem]:
        """Return the equations: force by travel, current by force, current by travel."""
        return tuple(
            Problem(self.unknowns, evaluate)
            for evaluate in (self.sensor_force, self.sensor_current, self.heart_current)
        )  # type: ignore[return-value]

    def touching(self, values: Array) -> Contacts:
        """Return the contacts."""
        return Contacts(float(values[_CLOSED]), float(values[_CLOSED] - values[_PLAY]))

    def slopes(self, values: Array) -> tuple[float, float]:
        """Return the stiffnesses tip to tip and through the wedge [N/m]."""
        c_S, c_W, c_C = 2.0 / values[_S], 2.0 / values[_W], 1.0 / values[_C]
        return float(1.0 / (c_S + c_C)), float(1.0 / (c_S + c_W))

    def sensor_force(self, values: Array) -> tuple[Array, Array]:
        """Return the straight line minus the sensor's force, and its derivatives."""
        stage, J = self.sensor, np.zeros((self.sensor.d.size, len(values)))
        K = 1.0 / (2.0 / values[_S] + 1.0 / self.par.rig.sensor.K_F)
        away = stage.d + stage.way * values[_LOOP] - values[_ZERO]
        J[:, _S] = away * K**2 * 2.0 / values[_S] ** 2
        J[:, _ZERO] = -K
        J[:, _LOOP] = K * stage.way
        return K * away - stage.F, J

    def sensor_current(self, values: Array) -> tuple[Array, Array]:
        """Return the law's current at the sensor's force minus the measured one."""
        stage, J = self.sensor, np.zeros((self.sensor.d.size, len(values)))
        i, J[:, _LAW], _ = law(stage.F, stage.way, values[_LAW])
        J[:, _SENSOR] = stage.waves
        return i + stage.waves @ values[_SENSOR] - stage.i, J

    def heart_force(self, values: Array, stage: Squeeze) -> tuple[Array, Array]:
        """Return the force in the heart at the travel, and its derivatives."""
        d, J = stage.d + stage.way * values[_LOOP], np.zeros((stage.d.size, len(values)))
        K_c, K_t = self.slopes(values)
        close = np.maximum(d - values[_CLOSED], 0.0)
        apart = np.maximum(values[_CLOSED] - values[_PLAY] - d, 0.0)
        J[:, _S] = (close * K_c**2 - apart * K_t**2) * 2.0 / values[_S] ** 2
        J[:, _W] = -apart * K_t**2 * 2.0 / values[_W] ** 2
        J[:, _C] = close * K_c**2 / values[_C] ** 2
        J[:, _CLOSED] = -K_c * (close > 0.0) - K_t * (apart > 0.0)
        J[:, _PLAY] = K_t * (apart > 0.0)
        J[:, _LOOP] = stage.way * (K_c * (close > 0.0) + K_t * (apart > 0.0))
        return K_c * close - K_t * apart, J

    def heart_current(self, values: Array) -> tuple[Array, Array]:
        """Return the law's current at the heart's force minus the measured one."""
        stage = self.heart
        F, J_F = self.heart_force(values, stage)
        i, columns, slope = law(F, stage.way, values[_LAW])
        J = slope[:, None] * J_F
        J[:, _LAW] = columns
        J[:, _HEART] = stage.waves
        return i + stage.waves @ values[_HEART] - stage.i, J

    def force_by_current(self, values: Array) -> Array:
        """Return the force from the heart's current, to first order around the fit."""
        F, _ = self.heart_force(values, self.heart)
        slope = law(F, self.heart.way, values[_LAW])[2]
        return np.asarray(F - self.heart_current(values)[0] / slope)

    def fits(self, values: Array, count: int) -> Check:
        """Check whether separate curves for each branch of both stages fit better.

        ``count``: number of estimated unknowns.
        """
        residuals = [part.evaluate(values)[0] for part in self.parts()]
        F, d = self.heart_force(values, self.heart)[0], self.sensor.d
        richer = (
            np.column_stack((np.vander(d / np.ptp(d), 4), self.sensor.way)),
            np.hstack((branches(self.sensor, 3, self.sensor.F), self.sensor.waves)),
            np.hstack((branches(self.heart, 3, F), self.heart.waves)),
        )
        rows, columns = sum(e.size for e in residuals), sum(A.shape[1] for A in richer)
        table, weights = np.zeros((rows, columns)), []
        row = column = 0
        for e, A in zip(residuals, richer, strict=True):
            table[row : row + e.size, column : column + A.shape[1]] = A
            row, column = row + e.size, column + A.shape[1]
            weights.append(np.full(e.size, 1.0 / max(float(np.sqrt(np.mean(e**2))), 1e-300)))
        return lack_of_fit(
            "left_over",
            np.concatenate(residuals),
            np.concatenate(weights),
            table,
            count,
            "whether force versus travel or current versus force deviates from the laws",
        )


_PASSES = 3  # fits: of the contacts, of the forces without kinks, and of both
_WITHIN = 0.5  # fraction of the clearance in which the wedge starts the test
_ADVICE = "Squeeze and pull with and without the brake heart, as 'bywire run force-cycle' does"


def identify(
    data: xr.Dataset, par: WedgeParameters, options: RigOptions, effort: Effort
) -> Identified:
    r"""Return stiffnesses of screws, interfaces and tips, and the free play.

    .. math::
        F = \frac{d - d_0}{2/K_S + 1/K_F}, \qquad
        F = \frac{\max(0, d - d_c)}{2/K_S + 1/K_C} - \frac{\max(0, d_t - d)}{2/K_S + 2/K_W}, \qquad
        d = d_q \pm h

    on the sensor and in the heart, with the travel d of one nut toward the other. The free play is
    :math:`d_c - d_t`. The encoders' :math:`d_q` lags behind the motion by h, and the damping of
    screws and sensor adds to h. In the heart, F comes from the current through the law of
    ``methods.force_calibration``, which is fitted to both stages at once. The fit omits windows in
    which a contact opens or closes, or has just done so.

    Parameters
    ----------
    data
        Two records, ``sensor`` and ``heart``, with ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad],
        ``y_F`` [N]. The fit does not use ``y_F`` of the second record. The sensor stiffness must
        be known.

    Raises
    ------
    ParameterError
        If a record is missing, does not move in both directions, or does not reach both contacts.

    References
    ----------
    Roberts et al. (2003), section "Drive train stiffnesses".
    """
    records = split(data)
    for label in LABELS:
        if label not in records:
            raise ParameterError(
                f"the measurement has no record {label} (it has {_named(records)}). "
                f"Specify one file for the record sensor and one for heart. {_ADVICE}",
                name=f"record {label}",
                value=_named(records),
            )
    sensor = squeeze(records["sensor"], par, options, "record sensor")
    heart = squeeze(records["heart"], par, options, "record heart", sensor.speed)
    stages, best, values, heart = _fitted(par, sensor, heart)
    F = stages.heart_force(values, stages.heart)[0]
    return Identified(
        estimates={"stiffness and free play": best},
        parameters={k: v for k, v in best.parameters().items() if k.startswith("heart.")},
        figures={
            "stiffness_tip_to_tip": (stages.slopes(values)[0], "N/m"),
            "stiffness_through_wedge": (stages.slopes(values)[1], "N/m"),
            "largest_compression": (float(F.max()), "N"),
            "largest_tension": (float(-F.min()), "N"),
        },
        checks=(stages.fits(values, len(best.values)),),
        curves=(_curve(replace(stages, heart=heart), values),),
        notes=(
            "the data determine the total free play, g_1 + g_2 + g_12, but not its parts",
            f"the fit assumes a sensor stiffness of {par.rig.sensor.K_F / 1e6:g} N/um",
        ),
    )


def _fitted(
    par: WedgeParameters, sensor: Squeeze, heart: Squeeze
) -> tuple[TwoStages, Estimate, Array, Squeeze]:
    """Return stages, fit, its values, and all windows in the heart.

    Each fit uses the contacts, and the force that slows the motors, from the previous fit.
    """
    contacts = started(par, sensor, heart, _ADVICE)
    for _ in range(_PASSES):
        clear = heart.only(clear_of(contacts, heart))
        stages = TwoStages(par, sensor, clear, contacts)
        best = steady_dynamics(stages.parts(), stages.unknowns, _ADVICE)
        estimates = {u.label: u.start for u in stages.unknowns}
        estimates |= dict(zip(best.names, best.values.tolist(), strict=True))
        values = np.array([estimates[u.label] for u in stages.unknowns])
        contacts = stages.touching(values)
        heart = heart.under(stages.heart_force(values, heart)[0], par)
    return stages, best, values, heart


def _named(records: dict[str, xr.Dataset]) -> str:
    return ", ".join(name for name in records if name) or "one without a name"


def _curve(stages: TwoStages, values: Array) -> Curve:
    """Return force versus travel in the brake heart, from the current and from the lines."""
    d = stages.heart.d
    order = np.argsort(d)
    rows = {
        "measured": stages.force_by_current(values)[order],
        "modeled": stages.heart_force(values, stages.heart)[0][order],
    }
    x = ("d", 1e3 * d[order], "mm", "travel toward each other")
    return Curve(
        "force-over-travel",
        "Force from the current versus travel in the brake heart, and the identified stiffnesses.",
        over(x, rows, "N", "force between the screws"),
        "d",
    )


def synthetic(par: WedgeParameters, options: RigOptions, seed: int) -> xr.Dataset:
    """Return both simulated stages with sensor noise. The heart has no force sensor."""
    on_sensor, in_heart = FORCE_CYCLE.cases(par, FORCE_CYCLE.defaults, None)
    random = np.random.default_rng(seed)
    sensors = drive_sensors(options)
    first = sensed(turned(on_sensor, random.uniform(0.0, 2.0 * np.pi)), sensors, random)
    angles = {f"q_{k}": Sensor(f"theta_{k}") for k in (1, 2)}
    away = random.uniform(-_WITHIN, _WITHIN) * par.caliper.clearance / slope_of(par)
    rest = {name: sensor for name, sensor in sensors.items() if name != "y_F"}
    second = sensed(turned(in_heart, away), rest | angles, random)
    for name in angles:
        angle: Any = second[name].values
        shown = shaft_encoder.reading(angle, par.encoder)
        second[name] = ("time", np.asarray(shown), second[name].attrs)
    second["y_F"] = ("time", np.zeros(second.sizes["time"]), first["y_F"].attrs)
    return joined({"sensor": first, "heart": second})


def truth(par: WedgeParameters, options: RigOptions) -> dict[str, float]:
    """Return the true free play and calibration of ``synthetic``."""
    known = {u.label: u.start for u in force_calibration.law_unknowns(par)}
    heart = par.heart
    return {
        "free_play": heart.g_1 + heart.g_2 + heart.g_12,
        "force_per_current": known["force_per_current"],
    }


METHOD = Method(
    name="stiffness",
    assembly="wedge-brake",
    summary="stiffnesses of screws, interfaces and tips, and free play, from a two-stage test",
    experiment="force-cycle",
    signals=SIGNALS,
    options=RigOptions,
    defaults=RigOptions(
        cutoff=20.0, slowest=0.2, margin=0.05, window=0.02, sigma_i=0.02, sigma_F=5.0
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=SIMULATED,
    unknowns=("heart.K_S", "heart.K_W", "heart.K_C"),
    several=True,
    truth=truth,
    further=MEANINGS,
)
