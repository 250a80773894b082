"""What a brake of one's own is written with: one place to import from, two levels deep.

Models, experiments, loops, methods, studies and sources of a user's package or file take their
names from here, wherever those stand inside bywire; elements come from ``bywire.plant`` and
``bywire.control``, functions of symbols from ``bywire.core.ops``. Everything is loaded on first
use, so that a listing loads no figures.

>>> from bywire.authoring import Brake, Part, chosen
>>> chosen(0.3, "a motor of this size").kind
'chosen'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bywire.analysis.linear.linear_model import LinearModel as LinearModel
    from bywire.analysis.linear.linearize import linearize as linearize
    from bywire.analysis.linear.plant import Plant as Plant
    from bywire.analysis.linear.plant import PlantPoint as PlantPoint
    from bywire.analysis.loop import Loop as Loop
    from bywire.analysis.loop import Point as Point
    from bywire.analysis.loop import Quantity as Quantity
    from bywire.bench.bench import Bench as Bench
    from bywire.bench.experiment import (
        Case as Case,
    )
    from bywire.bench.experiment import (
        Experiment as Experiment,
    )
    from bywire.bench.experiment import (
        Recordings as Recordings,
    )
    from bywire.bench.experiment import (
        as_run as as_run,
    )
    from bywire.bench.experiment import (
        fixed as fixed,
    )
    from bywire.bench.kpis import (
        effort as effort,
    )
    from bywire.bench.kpis import (
        hysteresis as hysteresis,
    )
    from bywire.bench.kpis import (
        occupation as occupation,
    )
    from bywire.bench.kpis import (
        step_response as step_response,
    )
    from bywire.bench.kpis.kpi import Kpi as Kpi
    from bywire.bench.kpis.kpi import Undefined as Undefined
    from bywire.bench.kpis.kpi import measure as measure
    from bywire.bench.kpis.registry import evaluate as evaluate
    from bywire.bench.kpis.registry import units_of as units_of
    from bywire.bench.result import Result as Result
    from bywire.bench.stimuli.registry import Stimulus as Stimulus
    from bywire.core import quantities as quantities
    from bywire.core import signals as signals
    from bywire.core import validity as validity
    from bywire.core.assembly import Assembly as Assembly
    from bywire.core.brake import Brake as Brake
    from bywire.core.catalog import CitedSet as CitedSet
    from bywire.core.catalog import parameters as parameters
    from bywire.core.errors import ModelError as ModelError
    from bywire.core.errors import ParameterError as ParameterError
    from bywire.core.model import Bounds as Bounds
    from bywire.core.model import Matrix as Matrix
    from bywire.core.model import Model as Model
    from bywire.core.model import Task as Task
    from bywire.core.parameters import ParameterSet as ParameterSet
    from bywire.core.parts import Integral as Integral
    from bywire.core.parts import Part as Part
    from bywire.core.parts import Shown as Shown
    from bywire.core.parts import Wire as Wire
    from bywire.core.provenance import (
        calibrated as calibrated,
    )
    from bywire.core.provenance import (
        chosen as chosen,
    )
    from bywire.core.provenance import (
        derived as derived,
    )
    from bywire.core.provenance import (
        paper as paper,
    )
    from bywire.core.quantities import (
        Area as Area,
    )
    from bywire.core.quantities import (
        BreakawayFactor as BreakawayFactor,
    )
    from bywire.core.quantities import (
        Conductance as Conductance,
    )
    from bywire.core.quantities import (
        Current as Current,
    )
    from bywire.core.quantities import (
        Damping as Damping,
    )
    from bywire.core.quantities import (
        Density as Density,
    )
    from bywire.core.quantities import (
        Duration as Duration,
    )
    from bywire.core.quantities import (
        DutyPerCurrent as DutyPerCurrent,
    )
    from bywire.core.quantities import (
        DutyPerCurrentTime as DutyPerCurrentTime,
    )
    from bywire.core.quantities import (
        Factor as Factor,
    )
    from bywire.core.quantities import (
        Force as Force,
    )
    from bywire.core.quantities import (
        Fraction as Fraction,
    )
    from bywire.core.quantities import (
        Frequency as Frequency,
    )
    from bywire.core.quantities import (
        Gain as Gain,
    )
    from bywire.core.quantities import (
        GearRatio as GearRatio,
    )
    from bywire.core.quantities import (
        Inductance as Inductance,
    )
    from bywire.core.quantities import (
        Inertia as Inertia,
    )
    from bywire.core.quantities import (
        InternalResistance as InternalResistance,
    )
    from bywire.core.quantities import (
        Length as Length,
    )
    from bywire.core.quantities import (
        Mass as Mass,
    )
    from bywire.core.quantities import (
        Nodes as Nodes,
    )
    from bywire.core.quantities import (
        Position as Position,
    )
    from bywire.core.quantities import (
        Pressure as Pressure,
    )
    from bywire.core.quantities import (
        Resistance as Resistance,
    )
    from bywire.core.quantities import (
        RotaryDamping as RotaryDamping,
    )
    from bywire.core.quantities import (
        SignedCurrent as SignedCurrent,
    )
    from bywire.core.quantities import (
        Stiffness as Stiffness,
    )
    from bywire.core.quantities import (
        TimeConstant as TimeConstant,
    )
    from bywire.core.quantities import (
        Torque as Torque,
    )
    from bywire.core.quantities import (
        TorqueConstant as TorqueConstant,
    )
    from bywire.core.quantities import (
        Unit as Unit,
    )
    from bywire.core.quantities import (
        Voltage as Voltage,
    )
    from bywire.core.quantities import (
        Volume as Volume,
    )
    from bywire.core.quantities import (
        Weight as Weight,
    )
    from bywire.core.signals import (
        Angle as Angle,
    )
    from bywire.core.signals import (
        ContactCompliance as ContactCompliance,
    )
    from bywire.core.signals import (
        Energy as Energy,
    )
    from bywire.core.signals import (
        Overlap as Overlap,
    )
    from bywire.core.signals import (
        Power as Power,
    )
    from bywire.core.signals import (
        Role as Role,
    )
    from bywire.core.signals import (
        Signal as Signal,
    )
    from bywire.core.signals import (
        Speed as Speed,
    )
    from bywire.core.signals import (
        zeros as zeros,
    )
    from bywire.core.typing import Array as Array
    from bywire.core.typing import Progress as Progress
    from bywire.identification.differentiation import differentiated as differentiated
    from bywire.identification.estimate import Estimate as Estimate
    from bywire.identification.least_squares import Problem as Problem
    from bywire.identification.least_squares import estimate as estimate
    from bywire.identification.measured import wrong_sign as wrong_sign
    from bywire.identification.method import (
        Check as Check,
    )
    from bywire.identification.method import (
        Curve as Curve,
    )
    from bywire.identification.method import (
        Effort as Effort,
    )
    from bywire.identification.method import (
        Identified as Identified,
    )
    from bywire.identification.method import (
        Method as Method,
    )
    from bywire.identification.residuals import lack_of_fit as lack_of_fit
    from bywire.identification.unknown import Unknown as Unknown
    from bywire.identification.unknown import parameters_of as parameters_of
    from bywire.report import style as style
    from bywire.report.bench_figures import FigureKind as FigureKind
    from bywire.report.panels import Panel as Panel
    from bywire.report.panels import Panels as Panels
    from bywire.report.panels import Trace as Trace
    from bywire.reproduction.item import (
        Fact as Fact,
    )
    from bywire.reproduction.item import (
        Item as Item,
    )
    from bywire.reproduction.item import (
        compared as compared,
    )
    from bywire.reproduction.item import (
        found as found,
    )
    from bywire.reproduction.reproduction import (
        Exhibit as Exhibit,
    )
    from bywire.reproduction.reproduction import (
        Reproduction as Reproduction,
    )
    from bywire.reproduction.reproduction import (
        Source as Source,
    )
    from bywire.reproduction.root_cause import RootCause as RootCause
    from bywire.reproduction.runs import Runs as Runs
    from bywire.reproduction.runs import kpis as kpis
    from bywire.simulation.run import Run as Run
    from bywire.simulation.run import simulate as simulate
    from bywire.synthesis.study import (
        Cut as Cut,
    )
    from bywire.synthesis.study import (
        Findings as Findings,
    )
    from bywire.synthesis.study import (
        Map as Map,
    )
    from bywire.synthesis.study import (
        Mark as Mark,
    )
    from bywire.synthesis.study import (
        Study as Study,
    )
    from bywire.synthesis.study import (
        require_ranges as require_ranges,
    )
    from bywire.synthesis.study import (
        variable as variable,
    )
    from bywire.synthesis.study import (
        variables as variables,
    )

_HOMES = {
    # a brake and its numbers
    "core.brake": "Brake",
    "core.catalog": "CitedSet parameters",
    "core.provenance": "calibrated chosen derived paper",
    "core.parameters": "ParameterSet",
    "core.errors": "ModelError ParameterError",
    "core.quantities": (
        "Area BreakawayFactor Conductance Current Damping Density Duration DutyPerCurrent "
        "DutyPerCurrentTime Factor Force Fraction Frequency Gain GearRatio Inductance "
        "Inertia InternalResistance Length Mass Nodes Position Pressure Resistance "
        "RotaryDamping SignedCurrent Stiffness TimeConstant Torque TorqueConstant Unit "
        "Voltage Volume Weight"
    ),
    # a model
    "core.assembly": "Assembly",
    "core.parts": "Integral Part Shown Wire",
    "core.model": "Bounds Matrix Model Task",
    "core.signals": "Angle ContactCompliance Energy Overlap Power Role Signal Speed zeros",
    "simulation.run": "Run simulate",
    # experiments and figures
    "bench.bench": "Bench",
    "bench.result": "Result",
    "bench.experiment": "Case Experiment Recordings as_run fixed",
    "bench.kpis.kpi": "Kpi Undefined measure",
    "bench.kpis.registry": "evaluate units_of",
    "bench.stimuli.registry": "Stimulus",
    "report.bench_figures": "FigureKind Shown:ShownFigure",
    "report.panels": "Panel Panels Trace",
    "report.line_role": "Role:LineRole",
    # loops, plants, studies
    "analysis.loop": "Loop Point Quantity",
    "analysis.linear.linear_model": "LinearModel",
    "analysis.linear.linearize": "linearize",
    "analysis.linear.plant": "Plant PlantPoint",
    "synthesis.study": "Cut Findings Map Mark Study require_ranges variable variables",
    "core.typing": "Array Progress",
    # identification
    "identification.differentiation": "differentiated",
    "identification.estimate": "Estimate",
    "identification.least_squares": "Problem estimate",
    "identification.measured": "wrong_sign",
    "identification.method": "Check Curve Effort Identified Method",
    "identification.residuals": "lack_of_fit",
    "identification.unknown": "Unknown parameters_of",
    # what sources state
    "reproduction.item": "Fact Item compared found",
    "reproduction.reproduction": "Exhibit Part:SourcePart Reproduction Source",
    "reproduction.root_cause": "RootCause",
    "reproduction.runs": "Runs kpis",
}
"""module -> what it gives, NAME:OTHER where it is called otherwise here"""

_MODULES = {
    "effort": "bench.kpis.effort",
    "hysteresis": "bench.kpis.hysteresis",
    "occupation": "bench.kpis.occupation",
    "quantities": "core.quantities",
    "signals": "core.signals",
    "step_response": "bench.kpis.step_response",
    "style": "report.style",
    "validity": "core.validity",
}
"""whole modules: families of key figures, types of quantities and signals, styles of figures"""

_PLACES = {
    other or name: (module, name)
    for module, names in _HOMES.items()
    for name, _, other in (each.partition(":") for each in names.split())
}

__all__ = sorted((*_PLACES, *_MODULES))


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"bywire.{_MODULES[name]}")
    if name not in _PLACES:
        raise AttributeError(f"module 'bywire.authoring' has no attribute {name!r}")
    module, attribute = _PLACES[name]
    return getattr(import_module(f"bywire.{module}"), attribute)


def __dir__() -> list[str]:
    return list(__all__)
