"""Park hot: clamp a hot disc, hold it without current while it cools, clamp again, and release."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    ParameterSet,
    Recordings,
    Stimulus,
    quantities,
)
from bywire.control import parking
from emb_caliper.models.parking import Parameters, ParkingBrake, released

Array = NDArray[np.float64]
RECORD = 0.02  # s
MEANINGS = {
    "time_to_park": "Time until the motor is switched off.",
    "first_force": "Clamp force 0.5 s after the first clamping.",
    "least_force": "Minimum clamp force while parked.",
    "creep": "Travel in the 10 s that follow.",
    "clamped_again": "How often the brake clamps again.",
    "residual_force": "Clamp force at the end.",
    "energy": "Energy from the battery.",
}
KPIS = (
    ("time_to_park", "s"),
    ("first_force", "N"),
    ("least_force", "N"),
    ("creep", "m"),
    ("clamped_again", "1"),
    ("residual_force", "N"),
    ("energy", "J"),
)


class Options(ParameterSet):
    """Disc temperature and times."""

    T_disc: quantities.Temperature
    """disc temperature when the brake is parked"""
    hold: Duration
    """time from the park demand to the release"""
    release: Duration
    """recording time after the release"""


def cases(par: Parameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run, from the released brake."""

    def stimulus(t: Array) -> dict[str, Array]:
        return {"park": np.where((t > -1e-9) & (t < options.hold - 1e-9), 1.0, 0.0)}

    def start(par: Parameters) -> tuple[object, object]:
        return released(par, options.T_disc)

    state, memory = start(par)
    duration = options.hold + options.release
    return (
        Case(
            "run",
            ParkingBrake(),
            par,
            state,
            memory,
            stimulus,
            duration,
            record=RECORD,
            start=start,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return force, travel and energy while the brake is parked, and the residual force."""
    run = recordings["run"]
    time, F, mode = (run[name].values for name in ("time", "F_cl", "mode"))
    parked = time < options.hold - 1e-6
    if not (parked & (mode == parking.HOLDS)).any():
        text = "the brake does not reach its force"
        return tuple(Kpi(name, float("nan"), unit, MEANINGS[name], text) for name, unit in KPIS)
    off = int(np.argmax(mode == parking.HOLDS))
    rested = int(np.searchsorted(time, time[off] + 0.5))
    steady = F[parked & (time >= time[rested])]
    after = parked & (time >= time[rested]) & (time <= time[rested] + 10.0)
    values = {
        "time_to_park": time[off],
        "first_force": F[rested],
        "least_force": steady.min(),
        "creep": np.ptp(run["travel"].values[after]),
        "clamped_again": run["clamped"].values[parked][-1],
        "residual_force": F[-1],
        "energy": run["E_source"].values[-1],
    }
    return tuple(Kpi(name, float(values[name]), unit, MEANINGS[name]) for name, unit in KPIS)


EXPERIMENT = Experiment(
    name="park-hot",
    assembly="emb-parking",
    summary="parking on a disc of {T_disc:degC}, which cools for {hold}",
    options=Options,
    defaults=Options(T_disc=573.15, hold=600.0, release=2.0),
    cases=cases,
    judge=judge,
    kpis=dict(KPIS),
    figures=("time-traces", "energy-balance"),
)
