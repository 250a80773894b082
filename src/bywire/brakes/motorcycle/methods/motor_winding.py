"""Resistance, inductance and back-EMF constant from voltage and current (2010, eq. 1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, Unit, Voltage
from bywire.data.labeled import labeled
from bywire.identification.electrics import (
    as_curve,
    believable,
    checks_of,
    levels,
    noise_of_levels,
    require_steps,
    winding_trial,
)
from bywire.identification.least_squares import estimate
from bywire.identification.measured import split
from bywire.identification.method import Effort, Identified, Method
from bywire.identification.output_error import output_error
from bywire.identification.unknown import parameters_of
from bywire.simulation.run import simulate

if TYPE_CHECKING:
    import xarray as xr

_NAMES = ("motor.R_m", "motor.L_m", "motor.K_e")
_TURNS = 1.0  # rad/s: a slower shaft is treated as locked
_STEP = 2e-6  # s, simulated experiment: a coarse step biases L_m if the shaft turns


class Options(ParameterSet):
    """The synthetic experiment."""

    rotor: Literal["stuck", "turning"]
    """shaft: held by friction under pressure, or turning away from the retracted end"""
    p_start: Pressure
    """pressure that the stuck piston holds"""
    i_low: Current
    """stuck: step size below the holding current, too small for breakaway"""
    i_high: Current
    """stuck: step size above the holding current, too small for breakaway"""
    v_high: Voltage
    """turning: maximum voltage"""
    dwell: Duration
    """time from one voltage step to the next"""
    duration: Duration
    """length of the record"""
    interval: Duration
    """sample time"""
    sigma_i: Annotated[float, Unit("A", 1e-2), Field(ge=0)]
    """noise of the measured current"""
    sigma_omega: Annotated[float, Unit("rad/s", 0.1), Field(ge=0)]
    """noise of the measured speed"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return R_m and L_m, and K_e if the shaft turns.

    Parameters
    ----------
    data
        ``v``: voltage at the motor, held between samples [V]; ``omega``: speed [rad/s], zero while
        the rotor is locked or sticks; ``i``: current [A] after the anti-alias filter, whose cutoff
        is ``anti_alias.f_aa``. One or several records.

    Raises
    ------
    ParameterError
        When neither voltage nor current changes.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (1), first line.
    """
    records = split(data)
    trials = []
    for label, record in records.items():
        require_steps(record, "v", "i", label)
        sigma = noise_of_levels(record["i"].values, record["v"].values)
        names = {"v": "v", "omega": "omega", "i": "i"}
        trials.append(winding_trial(par.motor, record, names, par.anti_alias.f_aa, sigma, label))
    turning = any(float(np.ptp(record["omega"].values)) > _TURNS for record in records.values())
    unknowns = parameters_of(par, _NAMES if turning else _NAMES[:2])
    fit = estimate(output_error(trials, unknowns))
    notes = (
        ()
        if turning
        else (
            "the shaft does not turn, so the data do not determine K_e. Turn the shaft and "
            "measure its speed",
        )
    )
    return Identified(
        estimates={"winding": fit},
        parameters=believable(fit),
        checks=checks_of(trials, fit),
        curves=tuple(as_curve(t, fit) for t in trials),
        notes=notes,
    )


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return simulated voltage steps of the whole brake, with sensor noise."""
    random = np.random.default_rng(seed)
    stuck = options.rotor == "stuck"
    source_par = par.replace({"drive.T_source": options.interval, "adc.law": "ideal"})
    p = options.p_start if stuck else 0.0
    low, high = 0.0, options.v_high
    if stuck:
        hold, R = holding_current(p, source_par), source_par.motor.R_m
        low, high = R * (hold - options.i_low), R * (hold + options.i_high)
    v = levels(low, high, options.duration, options.dwell, options.interval, seed=1)
    case = case_from_rest(
        "run",
        source_par,
        "voltage-source",
        p,
        lambda t: {"v_set": v(t)},
        options.duration,
        record=options.interval,
    )
    computed = simulate(as_run(case, _STEP), ("i_meas", "omega"))
    n = computed.time.size
    omega = computed["omega"] + (0.0 if stuck else random.normal(0.0, options.sigma_omega, n))
    i = computed["i_meas"] + random.normal(0.0, options.sigma_i, n)
    return labeled(
        {"time": (computed.time, "s", "time")},
        {
            "v": (v(computed.time), "V", "motor voltage"),
            "omega": (omega, "rad/s", "motor speed"),
            "i": (i, "A", "measured current"),
        },
    )


METHOD = Method(
    name="motor-winding",
    assembly="motorcycle-brake",
    summary="R_m and L_m from voltage steps, also K_e if the shaft turns (eq. (1) of Dardanelli "
    "et al.)",
    experiment="motor-open-loop",
    signals={"v": "V", "omega": "rad/s", "i": "A"},
    options=Options,
    defaults=Options(
        rotor="stuck",
        p_start=20e5,
        i_low=0.7,
        i_high=2.0,
        v_high=3.0,
        dwell=5e-3,
        duration=0.5,
        interval=1e-4,
        sigma_i=1e-2,
        sigma_omega=0.05,
    ),
    identify=identify,
    synthetic=synthetic,
    unknowns=_NAMES,
    several=True,
    simulated=tuple(Options.model_fields),
    bench_note="the record comes from a voltage source, with the rotor locked or at a set speed. "
    "The bench's shaft turns freely, so the bench cannot replay the record. Use only the values",
)
