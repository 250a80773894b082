"""Estimated clamp force: a stroke that trains the estimate, then one that shows its error."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    ParameterSet,
    Recordings,
    Stimulus,
    Unit,
)
from emb_caliper.case import Array, case_from_rest
from emb_caliper.experiments.slow_strokes import TopForce
from emb_caliper.parameters import BrakeParameters

FirstForce = Annotated[float, Unit("N", 1e4), Field(ge=0, allow_inf_nan=False)]


class Options(ParameterSet):
    """Both strokes, and what the force control uses."""

    F_train: FirstForce
    """clamp force of the training stroke; 0 for none"""
    F_top: TopForce
    """clamp force of the evaluated stroke"""
    shape: Literal["ramp", "step"]
    """evaluated stroke: a ramp up, hold and ramp down, or a step that stays"""
    t_ramp: Duration
    """rise and fall time of the demand"""
    t_hold: Duration
    """length of each hold, and of the pause before the evaluated stroke"""
    duration: Duration
    """time from the beginning of the evaluated stroke to the end"""
    feedback: Literal["sensor", "fallback", "estimate"]
    """source of the clamp force for control"""
    F_full: TopForce
    """full scale, to which errors refer"""


def begin(options: Options) -> float:
    """Return the time [s] at which the evaluated stroke begins."""
    o = options
    return round(2.0 * (o.t_ramp + o.t_hold), 3) if o.F_train > 0.0 else 0.0


def demand(t: Array, options: Options) -> Array:
    """Return the force demand [N] at times [s]."""
    o, start = options, begin(options)
    corners = np.cumsum((0.0, o.t_ramp, o.t_hold, o.t_ramp))
    training = np.interp(t, corners, (0.0, o.F_train, o.F_train, 0.0))
    evaluated = np.interp(t - start, corners, (0.0, o.F_top, o.F_top, 0.0))
    if o.shape == "step":
        evaluated = np.where(t >= start - 1e-9, o.F_top, 0.0)
    return training + evaluated


def cases(par: BrakeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run from the parked piston. Its ECU estimates the force."""
    changed = par.replace({"ecu.estimation": "on", "ecu.feedback": options.feedback})
    duration = round(begin(options) + options.duration, 6)
    return (
        case_from_rest(changed, "force", 0.0, lambda t: {"F_set": demand(t, options)}, duration),
    )


def held(values: Array, valid: Array) -> Array:
    """Return a signal that keeps its last valid value, and is zero before the first."""
    last = np.maximum.accumulate(np.where(valid, np.arange(values.size), -1))
    return np.where(last >= 0, values[np.maximum(last, 0)], 0.0)


def finish(recording: xr.Dataset, options: Options) -> xr.Dataset:
    """Return the recording with the error of the estimate."""
    error = recording["F_hat"] - recording["F_cl"]
    error.attrs = {"units": "N", "long_name": "error of the estimated clamp force"}
    return recording.assign(F_error=error)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the errors of the estimate and of its two sources, and what the ECU has learned."""
    run = recordings["run"]
    now = run["time"].values >= begin(options) - 1e-9
    F = run["F_cl"].values
    balance = held(run["F_balance"].values, run["balance_valid"].values > 0.5)
    balance = np.where(run["F_curve"].values > 0.0, np.maximum(balance, 0.0), 0.0)
    per_cent = 100.0 / options.F_full
    errors = {
        "estimate": per_cent * (run["F_hat"].values - F)[now],
        "curve": per_cent * (run["F_curve"].values - F)[now],
        "balance": per_cent * (balance - F)[now],
    }
    rms = {name: float(np.sqrt(np.mean(e * e))) for name, e in errors.items()}
    size = np.abs(errors["estimate"])
    of_full = "in % of full scale."
    return (
        Kpi("rms_error", rms["estimate"], "%", f"RMS error of the estimate, {of_full}"),
        Kpi("error_99", float(np.quantile(size, 0.99)), "%", f"99 % of errors, {of_full}"),
        Kpi("error_max", float(size.max()), "%", f"Maximum error of the estimate, {of_full}"),
        Kpi("rms_curve", rms["curve"], "%", f"RMS error of the curve alone, {of_full}"),
        Kpi(
            "rms_balance",
            rms["balance"],
            "%",
            f"RMS error of the torque balance alone, held at rest, {of_full}",
        ),
        Kpi(
            "contact_error",
            float(run["theta_0_hat"].values[-1]) - contact(run["theta"].values[now], F[now]),
            "rad",
            "Contact angle that the ECU has found, minus the true angle.",
        ),
        *_learned(run),
    )


def contact(theta: Array, F: Array) -> float:
    """Return the angle [rad] at which the pads touch, or NaN if the force does not increase.

    It is the angle at zero force of the parabola through the first three samples with force.
    """
    k = int(np.argmax(F > 0.0))
    if not (F[k : k + 3].size == 3 and F[k] > 0.0 and np.all(np.diff(F[k : k + 3]) > 0.0)):
        return float("nan")
    return float(np.polyfit(F[k : k + 3], theta[k : k + 3], 2)[-1])


def _learned(run: xr.Dataset) -> tuple[Kpi, ...]:
    """Return the properties in use at the end of the recording."""
    last = {
        name: float(run[name].values[-1]) for name in ("theta_0_hat", "s_hat", "C_hat", "G_hat")
    }
    return (
        Kpi("contact_angle", last["theta_0_hat"], "rad", "Contact angle that the ECU has found."),
        Kpi("stiffness_scale", last["s_hat"], "1", "Scale of the stiffness curve."),
        Kpi("friction_unloaded", last["C_hat"], "N*m", "Friction torque without load."),
        Kpi("friction_per_force", last["G_hat"], "N*m/N", "Friction torque per clamp force."),
        Kpi("strokes", float(run["strokes"].values[-1]), "1", "Strokes that trained the estimate."),
    )


EXPERIMENT = Experiment(
    name="estimated-force",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="stroke to {F_train:kN}, then to {F_top:kN}: error of the estimated clamp force",
    options=Options,
    defaults=Options(
        F_train=15e3,
        F_top=25e3,
        shape="ramp",
        t_ramp=0.5,
        t_hold=0.5,
        duration=2.0,
        feedback="sensor",
        F_full=25e3,
    ),
    cases=cases,
    judge=judge,
    finish=finish,
    kpis={
        "rms_error": "%",
        "error_99": "%",
        "error_max": "%",
        "rms_curve": "%",
        "rms_balance": "%",
        "contact_error": "rad",
        "contact_angle": "rad",
        "stiffness_scale": "1",
        "friction_unloaded": "N*m",
        "friction_per_force": "N*m/N",
        "strokes": "1",
    },
    figures=("time-traces", "energy-balance"),
)
