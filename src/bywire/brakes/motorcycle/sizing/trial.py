"""The sized motorcycle actuator on the nonlinear bench: the sine it was sized for, and a stop."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, as_run
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.recording import record
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.experiments import hard_braking
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sizing.demand import motion, sine
from bywire.core.typing import Array
from bywire.simulation.run import simulate

Par = MotorcycleParameters

WITHOUT_DITHER = {"ecu.dither.waveform": "off"}
_STEP = 20e-6
_SETTLE_PERIODS, _PERIODS = 10, 4
_HARMONICS = 5  # of the recorded sine that the fit takes into account
_ROUNDS, _CLOSE = 8, 0.01  # corrections of the demand's amplitude, and what counts as reached


def sine_figures(label: str, par: Par, top: float, amplitude: float, f: float) -> list[Kpi]:
    """Return what a sine in pressure takes on the bench, beside the calculation.

    The demand's mean and amplitude are corrected until the pressure, without dither, has the mean
    and the amplitude wanted at a frequency [Hz]: the loop itself may be slower than that.
    """
    mean, swing = top - amplitude, amplitude
    run, reached = _sine_run(par, mean, swing, f), 0.0
    # The fundamental is near proportional to the demand: two or three corrections are enough.
    for _ in range(_ROUNDS):
        run = _sine_run(par, mean, swing, f)
        middle, reached = _fitted(run, f)
        offset = top - amplitude - middle
        is_close = abs(reached / amplitude - 1.0) < _CLOSE and abs(offset) < _CLOSE * amplitude
        if is_close or reached <= 0.0:
            break
        swing *= min(amplitude / reached, 3.0)
        mean += offset
    wanted = motion(par, sine(par, top, amplitude, f))
    power = run["voltage"] * run["i"]
    note = "" if abs(reached / amplitude - 1.0) < 3 * _CLOSE else "the amplitude is not reached"
    text = "on the bench, dither off, over the calculated one"
    return [
        Kpi(f"{label}_bench_amplitude", reached, "Pa", "Amplitude of the pressure reached.", note),
        Kpi(
            f"{label}_bench_current",
            float(run["i"].max()) / float(wanted.current.max()),
            "1",
            f"Largest current of that sine {text}.",
            note,
        ),
        Kpi(
            f"{label}_bench_speed",
            float(np.abs(run["omega"]).max()) / float(np.abs(wanted.omega).max()),
            "1",
            f"Largest speed of that sine {text}.",
            note,
        ),
        Kpi(
            f"{label}_bench_power",
            float(power.max()) / float(wanted.electrical.max()),
            "1",
            f"Largest electrical power of that sine {text}.",
            note,
        ),
    ]


def braking_figures(label: str, par: Par, p_from: float, p_to: float) -> list[Kpi]:
    """Return key figures of experiment hard-braking between two pressures [Pa], dither as set."""
    experiment = hard_braking.EXPERIMENT
    following = {} if experiment.following is None else dict(experiment.following(par))
    options = experiment.defaults.replace({"p_from": p_from, "p_to": p_to, **following})
    (case,) = experiment.cases(par, options, None)
    kpis = {kpi.name: kpi for kpi in experiment.judge({"run": _recorded(case)}, options)}
    wanted = ("rise_time", "overshoot", "peak_current", "peak_power", "share_sat_current")
    return [
        Kpi(
            f"{label}_braking_{name}",
            kpis[name].value,
            kpis[name].unit,
            f"Hard braking: {kpis[name].definition}",
            kpis[name].note,
        )
        for name in wanted
    ]


def _sine_run(par: Par, mean: float, swing: float, f: float) -> xr.Dataset:
    w, settle = 2.0 * np.pi * f, _SETTLE_PERIODS / f + 0.5

    def stimulus(t: Array) -> dict[str, Array]:
        return {"p_set": mean + swing * np.sin(w * t)}

    case = case_from_rest(
        "sine",
        par,
        "pressure",
        mean,
        stimulus,
        round(_PERIODS / f, 3),
        WITHOUT_DITHER,
        settle=settle,
    )
    return _recorded(case)


def _fitted(run: xr.Dataset, f: float) -> tuple[float, float]:
    """Return mean and fundamental's amplitude of the pressure [Pa], by least squares."""
    angle = 2.0 * np.pi * f * run["time"].values
    waves = [wave(n * angle) for n in range(1, _HARMONICS + 1) for wave in (np.sin, np.cos)]
    columns = np.column_stack([np.ones_like(angle), *waves])
    coefficients = np.linalg.lstsq(columns, run["p_mc"].values, rcond=None)[0]
    return float(coefficients[0]), float(np.hypot(coefficients[1], coefficients[2]))


def _recorded(case: Case) -> xr.Dataset:
    run = as_run(case, _STEP)
    trajectory = simulate(run)
    if trajectory.status == "interrupted":
        raise KeyboardInterrupt
    return record(run, trajectory, case.settle, case.keep, {})
