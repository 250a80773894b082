"""Dummy shaft: position steps of a single motor with a solid shaft instead of the screw."""

from __future__ import annotations

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge import position_steps
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.position_steps import Options


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return one run per bandwidth and amplitude."""
    return position_steps.cases(par, options, {"rig.load": "dummy", "rig.clamp": "open"})


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of all steps."""
    return position_steps.judge(recordings, options)


EXPERIMENT = Experiment(
    name="dummy-shaft",
    assembly="wedge-brake",
    summary="position steps of a single motor with a dummy shaft, two bandwidths",
    options=Options,
    defaults=position_steps.DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=position_steps.UNITS,
    figures=("time-traces", "energy-balance"),
)
