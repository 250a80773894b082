"""Stiffnesses and free-play of the drive train from the two-stage test (Roberts 2003).

First the screws squeeze and pull a force sensor: stiffness of the screws, and what force a current
means. Then they work in the brake heart, where the current tells the force: tip to tip while they
close, through the wedge while they open, and nothing in between.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from bywire.brakes.wedge.experiments import force_cycle
from bywire.brakes.wedge.methods.drive_train import force_current, two_stages
from bywire.brakes.wedge.methods.drive_train.force_current import Reading, Squeeze, squeeze
from bywire.brakes.wedge.methods.drive_train.rig_measurement import (
    SIGNALS,
    SIMULATED,
    RigOptions,
    drive_sensors,
)
from bywire.brakes.wedge.methods.drive_train.two_stages import TwoStages
from bywire.brakes.wedge.methods.turned import turned
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import slope_of
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.equation import steady_dynamics
from bywire.identification.estimate import Estimate
from bywire.identification.measured import joined, split
from bywire.identification.method import Curve, Effort, Identified, Method
from bywire.identification.sensed import Sensor, sensed
from bywire.plant import shaft_encoder

_PASSES = 3  # a fit finds the contacts, one without their kinks the forces, one uses both
_WITHIN = 0.5  # of the clearance, in which the wedge stands when the test begins
_ADVICE = "squeeze and pull with and without the brake heart, as 'bywire run force-cycle' does"


def identify(
    data: xr.Dataset, par: WedgeParameters, options: RigOptions, effort: Effort
) -> Identified:
    r"""Return stiffnesses of screws, interfaces and tips, and the free-play.

    .. math::
        F = \frac{d - d_0}{2/K_S + 1/K_F}, \qquad
        F = \frac{\max(0, d - d_c)}{2/K_S + 1/K_C} - \frac{\max(0, d_t - d)}{2/K_S + 2/K_W}, \qquad
        d = d_q \pm h

    on the sensor and in the heart, with the travel d of one nut toward the other; the free-play is
    :math:`d_c - d_t`. What the encoders show, :math:`d_q`, stays behind the motion by h, and the
    damping of screws and sensor counts as more of it. In the heart F is what the current says, by
    the law of ``methods.drive_train.force_current``, which is fitted to both stages at once;
    windows in which a contact opens or closes, or has just done so, are left out.

    Parameters
    ----------
    data
        Two records, ``sensor`` and ``heart``: ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad],
        ``y_F`` [N], which the second does not use. Known is the sensor's stiffness.

    Raises
    ------
    ParameterError
        When a record is missing, does not move both ways, or does not reach both contacts.

    References
    ----------
    Roberts et al. (2003), section "Drive train stiffnesses".
    """
    records = split(data)
    for label in force_cycle.LABELS:
        if label not in records:
            raise ParameterError(
                f"the measurement has no record {label} (it has {_named(records)}): "
                f"give one file each, sensor and heart; {_ADVICE}"
            )
    sensor = squeeze(records["sensor"], par, _reading(options, None), "record sensor")
    heart = squeeze(records["heart"], par, _reading(options, sensor.speed), "record heart")
    stages, best, values, heart = _fitted(par, sensor, heart)
    F = stages.heart_force(values, stages.heart)[0]
    return Identified(
        estimates={"stiffness and free-play": best},
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
            "free-play is told as a whole: g_1 + g_2 + g_12; how it is shared is not",
            f"the sensor's stiffness is taken as {par.rig.sensor.K_F / 1e6:g} N/um",
        ),
    )


def _fitted(
    par: WedgeParameters, sensor: Squeeze, heart: Squeeze
) -> tuple[TwoStages, Estimate, Array, Squeeze]:
    """Return stages, fit, its values, and all windows in the heart.

    Where contacts change, and what force slows the motors, the fit before tells.
    """
    contacts = two_stages.started(par, sensor, heart, _ADVICE)
    for _ in range(_PASSES):
        clear = heart.only(two_stages.clear_of(contacts, heart))
        stages = TwoStages(par, sensor, clear, contacts)
        best = steady_dynamics(stages.parts(), stages.unknowns, _ADVICE)
        known = {u.label: u.start for u in stages.unknowns}
        known |= dict(zip(best.names, best.values.tolist(), strict=True))
        values = np.array([known[u.label] for u in stages.unknowns])
        contacts = stages.touching(values)
        heart = heart.under(stages.heart_force(values, heart)[0], par)
    return stages, best, values, heart


def _named(records: dict[str, xr.Dataset]) -> str:
    return ", ".join(name for name in records if name) or "one without a name"


def _reading(options: RigOptions, speed: float | None) -> Reading:
    return Reading(options.cutoff, options.slowest, options.margin, options.window, speed)


def _curve(stages: TwoStages, values: Array) -> Curve:
    """Return the brake heart's force over travel, by the current and by the straight lines."""
    d = stages.heart.d
    order = np.argsort(d)
    rows = {
        "measured": stages.force_by_current(values)[order],
        "modeled": stages.heart_force(values, stages.heart)[0][order],
    }
    x = ("d", 1e3 * d[order], "mm", "travel toward each other")
    return Curve(
        "force-over-travel",
        "Force by the current over travel in the brake heart, and the identified stiffnesses.",
        over(x, rows, "N", "force between the screws"),
        "d",
    )


def synthetic(par: WedgeParameters, options: RigOptions, seed: int) -> xr.Dataset:
    """Return both stages, simulated, with the sensors' noise; there is no force in the heart."""
    experiment = force_cycle.EXPERIMENT
    on_sensor, in_heart = experiment.cases(par, experiment.defaults, None)
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
    """Return free-play and calibration that ``synthetic`` puts in."""
    known = {u.label: u.start for u in force_current.unknowns(par)}
    heart = par.heart
    return {
        "free_play": heart.g_1 + heart.g_2 + heart.g_12,
        "force_per_current": known["force_per_current"],
    }


METHOD = Method(
    name="stiffness",
    assembly="wedge-brake",
    summary="stiffness of screws, interfaces, tips, and free-play, on a sensor and in the heart",
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
    further=two_stages.MEANINGS,
)
