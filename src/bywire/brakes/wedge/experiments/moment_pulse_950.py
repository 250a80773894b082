"""Large moment pulse: up to 950 N m and back to the parking position (Roberts 2003, Fig. 9)."""

from __future__ import annotations

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    BRAKING,
    braking,
    case_from_parked,
    parking_time,
    release_time,
    steps,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment, SpeedLimit
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration

PEAKS = Figures(
    peak_moment=("N*m", "Largest moment."),
    peak_angle=("rad", "Largest common reference of both motors, from the parking position."),
)


class Options(ParameterSet):
    """The braking maneuver; its times are ours, the figure's text gives none."""

    M_high: SomeMoment
    """moment demanded"""
    t_pulse: Duration
    """length of the pulse"""
    t_end: Duration
    """time recorded after it"""
    omega_gap: SpeedLimit
    """largest speed while crossing the gap, lower here than in Figs. 7 and 8"""
    settle: Duration
    """time parked before the pulse"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    levels = {0.0: options.M_high, options.t_pulse: 0.0}
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            options.t_pulse + options.t_end,
            {"control.moment.omega_gap": options.omega_gap},
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of the braking and of the release."""
    run = along_disc(recordings["run"])
    return (
        *braking(run, options.M_high, options.t_pulse),
        *PEAKS(peak_moment=run["M_B"].max(), peak_angle=np.abs(run["theta_ref"]).max()),
        release_time(run, options.t_pulse),
        parking_time(run, options.t_pulse),
    )


EXPERIMENT = Experiment(
    name="moment-pulse-950",
    assembly="wedge-brake",
    summary="moment pulse of {M_high} on the software rate limit (Fig. 9)",
    options=Options,
    defaults=Options(M_high=950.0, t_pulse=0.2, t_end=0.3, omega_gap=60.0, settle=0.05),
    cases=cases,
    judge=judge,
    kpis=BRAKING.units | PEAKS.units | {"release_time": "s", "parking_time": "s"},
    figures=("time-traces", "energy-balance"),
)
