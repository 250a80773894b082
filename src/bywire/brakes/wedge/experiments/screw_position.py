"""Screw position: position steps of a single motor that turns a preloaded roller screw."""

from __future__ import annotations

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge import position_steps
from bywire.brakes.wedge.case import parameters_of
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.position_steps import Options
from bywire.brakes.wedge.rigs.shaft_rig import friction

_LOOPS = ("low", "high")
BAND = Figures(
    dead_band=("rad", "Angle error that friction and cogging at rest can hold, by their laws."),
)


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return one run per bandwidth and amplitude."""
    return position_steps.cases(par, options, {"rig.load": "screw", "rig.clamp": "open"})


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of all steps, and the error within which friction holds the shaft."""
    bands: list[Kpi] = []
    for loop in _LOOPS:
        par = parameters_of(recordings[f"{loop}_small"])
        held = max(abs(bound) for bound in friction(0.0, 0.0, par))
        band = (held + par.motor_1.T_cog) / position_steps.stiffness(par)
        bands += BAND(f"_{loop}", dead_band=band)
    return (*position_steps.judge(recordings, options), *bands)


EXPERIMENT = Experiment(
    name="screw-position",
    assembly="wedge-brake",
    summary="position steps of a single motor with a preloaded roller screw, two bandwidths",
    options=Options,
    defaults=position_steps.DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=position_steps.UNITS | BAND.ending(*(f"_{loop}" for loop in _LOOPS)),
    figures=("time-traces", "energy-balance"),
)
