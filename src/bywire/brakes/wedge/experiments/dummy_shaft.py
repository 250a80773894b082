"""Dummy shaft: position steps of a single motor with a solid shaft instead of the screw."""

from __future__ import annotations

from bywire.bench.experiment import Experiment
from bywire.brakes.wedge import position_steps

EXPERIMENT = Experiment(
    name="dummy-shaft",
    assembly="wedge-brake",
    summary="position steps of a single motor with a dummy shaft, two bandwidths",
    options=position_steps.Options,
    defaults=position_steps.DEFAULTS,
    cases=lambda par, options, _: position_steps.cases(
        par, options, {"rig.load": "dummy", "rig.clamp": "open"}
    ),
    judge=position_steps.judge,
    kpis=position_steps.UNITS,
    figures=("time-traces", "energy-balance"),
)
