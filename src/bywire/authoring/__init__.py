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
    from bywire.analysis.linear.closed_loop import closed_loop
    from bywire.analysis.linear.linear_model import LinearModel
    from bywire.analysis.linear.linearize import linearize
    from bywire.analysis.linear.plant import Plant, PlantPoint
    from bywire.analysis.loop import LOOPS, Loop, Point, Quantity
    from bywire.bench.bench import Bench
    from bywire.bench.experiment import Case, Experiment, Recordings, as_run, fixed
    from bywire.bench.kpis import effort, hysteresis, occupation, step_response
    from bywire.bench.kpis.cases import FamilyJudge
    from bywire.bench.kpis.kpi import Figures, Kpi, Undefined, measure
    from bywire.bench.kpis.registry import evaluate, units_of
    from bywire.bench.result import Result
    from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange
    from bywire.bench.stimuli.registry import Stimulus
    from bywire.campaigns.declared import DeclaredCampaign
    from bywire.campaigns.residual import Residual
    from bywire.core import quantities, signals, validity
    from bywire.core.assembly import Assembly
    from bywire.core.brake import Brake
    from bywire.core.catalog import CitedSet, parameters
    from bywire.core.errors import ModelError, ParameterError
    from bywire.core.faults import Channel, Channels, Fault, ParameterFault
    from bywire.core.model import Bounds, Matrix, Model, Task
    from bywire.core.parameters import ParameterSet
    from bywire.core.parts import Integral, Part, Port, Shown, Wire
    from bywire.core.provenance import calibrated, chosen, derived, paper
    from bywire.core.quantities import (
        Area,
        BreakawayFactor,
        Conductance,
        Current,
        Damping,
        Density,
        Duration,
        DutyPerCurrent,
        DutyPerCurrentTime,
        Factor,
        Force,
        Fraction,
        Frequency,
        Gain,
        GearRatio,
        Inductance,
        Inertia,
        InternalResistance,
        Length,
        Mass,
        Nodes,
        Position,
        Pressure,
        Resistance,
        RotaryDamping,
        SignedCurrent,
        Stiffness,
        TimeConstant,
        Torque,
        TorqueConstant,
        Unit,
        Voltage,
        Volume,
        Weight,
    )
    from bywire.core.signals import (
        Angle,
        ContactCompliance,
        Energy,
        Limited,
        Overlap,
        Power,
        Role,
        Signal,
        Speed,
        zeros,
    )
    from bywire.core.subassembly import Sub
    from bywire.core.typing import Array, Progress
    from bywire.identification.differentiation import differentiated
    from bywire.identification.estimate import Estimate
    from bywire.identification.least_squares import Problem, estimate
    from bywire.identification.measured import measured, wrong_sign
    from bywire.identification.method import METHODS, Check, Curve, Effort, Identified, Method
    from bywire.identification.moved_run import moved_run
    from bywire.identification.replaying.tracking import track
    from bywire.identification.residuals import lack_of_fit
    from bywire.identification.unknown import Unknown, parameters_of
    from bywire.life.declaration import Effects, Life, Slow
    from bywire.report import style
    from bywire.report.bench_figures import FigureKind
    from bywire.report.bench_figures import Shown as ShownFigure
    from bywire.report.line_role import Role as LineRole
    from bywire.report.live_page.sliders import Sliders
    from bywire.report.panels import Panel, Panels, Trace
    from bywire.reproduction.item import Fact, Item, compared, found
    from bywire.reproduction.reproduction import Exhibit, Reproduction, Source
    from bywire.reproduction.reproduction import Part as SourcePart
    from bywire.reproduction.root_cause import RootCause
    from bywire.reproduction.runs import Runs, kpis
    from bywire.reproduction.source_file import SourceFile
    from bywire.simulation.run import Run, simulate
    from bywire.synthesis.study import (
        Cut,
        Findings,
        Map,
        Mark,
        Study,
        require_ranges,
        variable,
        variables,
    )

_HOMES = {
    # a brake and its numbers
    "core.brake": "Brake",
    "core.catalog": "CitedSet parameters",
    "core.provenance": "calibrated chosen derived paper",
    "core.parameters": "ParameterSet",
    "core.errors": "ModelError ParameterError",
    "core.faults": "Channel Channels Fault ParameterFault",
    "campaigns.declared": "DeclaredCampaign",
    "campaigns.residual": "Residual",
    "core.quantities": (
        "Area BreakawayFactor Conductance Current Damping Density Duration DutyPerCurrent "
        "DutyPerCurrentTime Factor Force Fraction Frequency Gain GearRatio Inductance "
        "Inertia InternalResistance Length Mass Nodes Position Pressure Resistance "
        "RotaryDamping SignedCurrent Stiffness TimeConstant Torque TorqueConstant Unit "
        "Voltage Volume Weight"
    ),
    # a model
    "core.assembly": "Assembly",
    "core.parts": "Integral Part Port Shown Wire",
    "core.subassembly": "Sub",
    "core.model": "Bounds Matrix Model Task",
    "core.signals": "Angle ContactCompliance Energy Limited Overlap Power Role Signal Speed zeros",
    "simulation.run": "Run simulate",
    # experiments and figures
    "bench.bench": "Bench",
    "bench.result": "Result",
    "bench.stated": "StatedFigure StatedLevel StatedRange",
    "bench.experiment": "Case Experiment Recordings as_run fixed",
    "bench.kpis.cases": "FamilyJudge",
    "bench.kpis.kpi": "Figures Kpi Undefined measure",
    "bench.kpis.registry": "evaluate units_of",
    "bench.stimuli.registry": "Stimulus",
    "report.bench_figures": "FigureKind Shown:ShownFigure",
    "report.live_page.sliders": "Sliders",
    "report.panels": "Panel Panels Trace",
    "report.line_role": "Role:LineRole",
    # loops, plants, studies
    "analysis.loop": "LOOPS Loop Point Quantity",
    "analysis.linear.closed_loop": "closed_loop",
    "analysis.linear.linear_model": "LinearModel",
    "analysis.linear.linearize": "linearize",
    "analysis.linear.plant": "Plant PlantPoint",
    "synthesis.study": "Cut Findings Map Mark Study require_ranges variable variables",
    "life.declaration": "Effects Life Slow",
    "core.typing": "Array Progress",
    # identification
    "identification.differentiation": "differentiated",
    "identification.estimate": "Estimate",
    "identification.least_squares": "Problem estimate",
    "identification.measured": "measured wrong_sign",
    "identification.moved_run": "moved_run",
    "identification.replaying.tracking": "track",
    "identification.method": "METHODS Check Curve Effort Identified Method",
    "identification.residuals": "lack_of_fit",
    "identification.unknown": "Unknown parameters_of",
    # what sources state
    "reproduction.item": "Fact Item compared found",
    "reproduction.reproduction": "Exhibit Part:SourcePart Reproduction Source",
    "reproduction.root_cause": "RootCause",
    "reproduction.runs": "Runs kpis",
    "reproduction.source_file": "SourceFile",
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

__all__ = [
    "LOOPS",
    "METHODS",
    "Angle",
    "Area",
    "Array",
    "Assembly",
    "Bench",
    "Bounds",
    "Brake",
    "BreakawayFactor",
    "Case",
    "Channel",
    "Channels",
    "Check",
    "CitedSet",
    "Conductance",
    "ContactCompliance",
    "Current",
    "Curve",
    "Cut",
    "Damping",
    "DeclaredCampaign",
    "Density",
    "Duration",
    "DutyPerCurrent",
    "DutyPerCurrentTime",
    "Effects",
    "Effort",
    "Energy",
    "Estimate",
    "Exhibit",
    "Experiment",
    "Fact",
    "Factor",
    "FamilyJudge",
    "Fault",
    "FigureKind",
    "Figures",
    "Findings",
    "Force",
    "Fraction",
    "Frequency",
    "Gain",
    "GearRatio",
    "Identified",
    "Inductance",
    "Inertia",
    "Integral",
    "InternalResistance",
    "Item",
    "Kpi",
    "Length",
    "Life",
    "Limited",
    "LineRole",
    "LinearModel",
    "Loop",
    "Map",
    "Mark",
    "Mass",
    "Matrix",
    "Method",
    "Model",
    "ModelError",
    "Nodes",
    "Overlap",
    "Panel",
    "Panels",
    "ParameterError",
    "ParameterFault",
    "ParameterSet",
    "Part",
    "Plant",
    "PlantPoint",
    "Point",
    "Port",
    "Position",
    "Power",
    "Pressure",
    "Problem",
    "Progress",
    "Quantity",
    "Recordings",
    "Reproduction",
    "Residual",
    "Resistance",
    "Result",
    "Role",
    "RootCause",
    "RotaryDamping",
    "Run",
    "Runs",
    "Shown",
    "ShownFigure",
    "Signal",
    "SignedCurrent",
    "Sliders",
    "Slow",
    "Source",
    "SourceFile",
    "SourcePart",
    "Speed",
    "StatedFigure",
    "StatedLevel",
    "StatedRange",
    "Stiffness",
    "Stimulus",
    "Study",
    "Sub",
    "Task",
    "TimeConstant",
    "Torque",
    "TorqueConstant",
    "Trace",
    "Undefined",
    "Unit",
    "Unknown",
    "Voltage",
    "Volume",
    "Weight",
    "Wire",
    "as_run",
    "calibrated",
    "chosen",
    "closed_loop",
    "compared",
    "derived",
    "differentiated",
    "effort",
    "estimate",
    "evaluate",
    "fixed",
    "found",
    "hysteresis",
    "kpis",
    "lack_of_fit",
    "linearize",
    "measure",
    "measured",
    "moved_run",
    "occupation",
    "paper",
    "parameters",
    "parameters_of",
    "quantities",
    "require_ranges",
    "signals",
    "simulate",
    "step_response",
    "style",
    "track",
    "units_of",
    "validity",
    "variable",
    "variables",
    "wrong_sign",
    "zeros",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"bywire.{_MODULES[name]}")
    if name not in _PLACES:
        raise AttributeError(f"module 'bywire.authoring' has no attribute {name!r}")
    module, attribute = _PLACES[name]
    return getattr(import_module(f"bywire.{module}"), attribute)


def __dir__() -> list[str]:
    return list(__all__)
