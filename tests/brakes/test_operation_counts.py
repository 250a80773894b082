"""How many operations every kernel of ours takes: the price of how its model is written.

A model written another way must not cost more. Counted in the graph from which C is emitted, after
all that is shared or folded: per pass of a substep, recorded row and tick. Whether a substep is cut
is asked by comparisons joined: more operations than a largest difference, which wait for nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.rigs.driven_shaft import DrivenShaft
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import Model
from bywire.core.parameters import choice_fields
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node
from bywire.simulation.program import build_program
from bywire.simulation.stages import build_stages

CURVE = {"caliper.p_table": (0.0, 1e5, 5e5, 20e5), "caliper.V_table": (0.0, 1e-8, 3e-8, 8e-8)}
BENT = {"caliper.n_table": (0.0, 1e-4, 3e-4), "caliper.F_table": (0.0, 2e3, 9e3)}
AIR = {"fluid.air": "entrained", "fluid.V_air": 2e-8}
ALL = {"gear.law": "directional", "caliper.law": "compressible", "port.law": "dead-stroke", **AIR}

Counts = tuple[int, int, int, tuple[int, ...]]
"""fast pass, exact pass, recorded row, ticks"""
MOTORCYCLE: list[tuple[dict[str, Any], Counts]] = [
    ({}, (243, 644, 136, (131,))),
    ({"gear.law": "directional"}, (276, 685, 151, (131,))),
    ({"caliper.law": "compressible"}, (253, 649, 151, (131,))),
    ({"caliper.law": "table", **CURVE}, (262, 658, 218, (131,))),
    ({**AIR}, (254, 653, 164, (131,))),
    ({"fluid.air": "caliper", "fluid.V_air": 2e-8}, (263, 659, 213, (131,))),
    ({"port.law": "dead-stroke"}, (264, 662, 136, (131,))),
    ({"port.law": "leaking", "caliper.leak": "leaking"}, (255, 655, 136, (131,))),
    ({"pressure_sensor.place": "mid-pipeline"}, (246, 647, 136, (131,))),
    ({"adc.law": "ideal"}, (243, 644, 136, (117,))),
    ({"ecu.schedule.law": "regions"}, (243, 644, 136, (179,))),
    ({"ecu.filter.place": "before-dither"}, (243, 644, 136, (131,))),
    ({"ecu.dither.waveform": "off"}, (243, 644, 136, (116,))),
    ({"ecu.dither.waveform": "square"}, (243, 644, 136, (131,))),
    ({"ecu.dither.waveform": "triangle"}, (243, 644, 136, (136,))),
    ({"caliper.fluid_heat": "warming"}, (251, 652, 136, (131,))),
    ({"piston.law": "sticking"}, (349, 741, 146, (131,))),
    ({"motor_heat.law": "lumped"}, (287, 688, 147, (131,))),
    ({"ecu.derating.law": "current"}, (243, 644, 136, (175,))),
    ({"drive.mode": "pedal"}, (243, 644, 136, (160,))),
    ({"drive.mode": "current"}, (243, 644, 136, (100,))),
    ({"drive.mode": "current-direct"}, (243, 644, 136, (43,))),
    ({"drive.mode": "voltage-source"}, (236, 637, 163, (11,))),
    ({"drive.mode": "current-source"}, (219, 619, 168, (11,))),
    (ALL, (316, 720, 193, (131,))),
    ({**ALL, "drive.mode": "voltage-source"}, (309, 713, 220, (11,))),
    ({**ALL, "drive.mode": "current-source"}, (292, 695, 225, (11,))),
]
WEDGE: list[tuple[dict[str, Any], Counts]] = [
    ({}, (1528, 3616, 450, (109, 98))),
    ({"screw.law": "drive", "encoder.law": "ideal"}, (1514, 3602, 450, (98, 86))),
    ({"caliper.law": "table", **BENT, "flywheel.law": "driven",
      "control.offset.law": "scheduled"}, (1596, 3672, 472, (109, 111))),
    ({"wedge_friction.stopped_disc": "stick", "command.mode": "position"},
     (1534, 3622, 450, (70,))),
    ({"motor_heat.law": "lumped", "control.derating.law": "current"},
     (1605, 3693, 477, (109, 158))),
    ({"adjuster.law": "screw", "control.adjuster.ways": "both",
      "control.adjuster.fault": "none"}, (1548, 3637, 456, (114, 72, 98))),
    ({"command.mode": "current"}, (1528, 3616, 450, (3,))),
]
RIGS: list[tuple[type[Model], dict[str, Any], Counts]] = [
    (ScrewRig, {}, (565, 875, 92, (67,))),
    (ScrewRig, {"rig.mode_1": "current"}, (565, 875, 92, (54,))),
    (ScrewRig, {"rig.mode_2": "current"}, (565, 875, 92, (54,))),
    (ScrewRig, {"screw.law": "drive"}, (556, 866, 92, (67,))),
    (ShaftRig, {}, (246, 287, 43, (43,))),
    (ShaftRig, {"rig.load": "dummy"}, (227, 268, 47, (43,))),
    (ShaftRig, {"rig.clamp": "closed"}, (248, 289, 43, (43,))),
    (ShaftRig, {"rig.mode_1": "current"}, (246, 287, 42, (22,))),
    (ShaftRig, {"screw.law": "drive"}, (234, 275, 43, (43,))),
    (DrivenShaft, {}, (92, 133, 0, (0,))),
    (DrivenShaft, {"rig.load": "dummy"}, (93, 134, 0, (0,))),
    (DrivenShaft, {"screw.law": "drive"}, (84, 125, 0, (0,))),
]
CASES = [
    *((MotorcycleBrake, "dardanelli2010", changes, counts) for changes, counts in MOTORCYCLE),
    *((WedgeBrake, "roberts2003", changes, counts) for changes, counts in WEDGE),
    *((model, "roberts2003", changes, counts) for model, changes, counts in RIGS),
]


def counted(model: Model, par: Any) -> Counts:
    stages = build_stages(build_program(model, par))

    def operations(roots: Iterable[Node]) -> int:
        return _operations(stages.graph, list(roots))

    return (
        operations(node for nodes in stages.fast.values() for node in nodes),
        operations(node for nodes in stages.exact.values() for node in nodes),
        operations(stages.output),
        tuple(operations(tick) for tick in stages.ticks),
    )


def _operations(graph: Graph, roots: list[Node]) -> int:
    return sum(1 for _ in needed(graph, roots, lambda _: False))


def _label(case: Any) -> str:
    model, _, changes, _ = case
    return f"{model.name} {' '.join(str(v) for v in changes.values() if isinstance(v, str))}"


@pytest.mark.parametrize(("model", "source", "changes", "counts"), CASES, ids=map(_label, CASES))
def test_kernels_take_as_many_operations_as_ever(
    model: type[Model], source: str, changes: dict[str, Any], counts: Counts
) -> None:
    par = PARAMETER_SETS.find(source).parameters().replace(changes)
    assert counted(model(), par) == counts


@pytest.mark.parametrize(
    ("source", "rows"), [("dardanelli2010", MOTORCYCLE), ("roberts2003", [*WEDGE])]
)
def test_every_choice_is_counted(source: str, rows: list[tuple[dict[str, Any], Counts]]) -> None:
    par = PARAMETER_SETS.find(source).parameters()
    changed = {name for changes, _ in rows for name in changes}
    changed |= {name for _, changes, _ in RIGS for name in changes}
    assert set(choice_fields(type(par))) <= changed
