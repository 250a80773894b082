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
from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear
from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import DrivenShaft, ShaftRig
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import Model
from bywire.core.parameters import choice_fields
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.program import build_program
from bywire.simulation.stages import build_stages

CURVE = {"caliper.p_table": (0.0, 1e5, 5e5, 20e5), "caliper.V_table": (0.0, 1e-8, 3e-8, 8e-8)}
BENT = {"caliper.n_table": (0.0, 1e-4, 3e-4), "caliper.F_table": (0.0, 2e3, 9e3)}
AIR = {"fluid.air": "entrained", "fluid.V_air": 2e-8}
ALL = {"gear.law": "directional", "caliper.law": "compressible", "port.law": "dead-stroke", **AIR}

Counts = tuple[int, int, int, tuple[int, ...]]
"""fast pass, exact pass, recorded row, ticks"""
MOTORCYCLE: list[tuple[dict[str, Any], Counts]] = [
    ({}, (247, 228, 136, (131,))),
    ({"gear.law": "directional"}, (280, 273, 151, (131,))),
    ({"caliper.law": "compressible"}, (257, 236, 151, (131,))),
    ({"caliper.law": "table", **CURVE}, (266, 244, 218, (131,))),
    ({**AIR}, (258, 228, 164, (131,))),
    ({"fluid.air": "caliper", "fluid.V_air": 2e-8}, (267, 245, 213, (131,))),
    ({"port.law": "dead-stroke"}, (268, 239, 136, (131,))),
    ({"port.law": "leaking", "caliper.leak": "leaking"}, (259, 236, 136, (131,))),
    ({"pressure_sensor.place": "mid-pipeline"}, (250, 231, 136, (131,))),
    ({"adc.law": "ideal"}, (247, 228, 136, (117,))),
    ({"ecu.schedule.law": "regions"}, (247, 228, 136, (179,))),
    ({"ecu.filter.place": "before-dither"}, (247, 228, 136, (131,))),
    ({"ecu.dither.waveform": "off"}, (247, 228, 136, (116,))),
    ({"ecu.dither.waveform": "square"}, (247, 228, 136, (131,))),
    ({"ecu.dither.waveform": "triangle"}, (247, 228, 136, (136,))),
    ({"caliper.fluid_heat": "warming"}, (255, 234, 136, (131,))),
    ({"piston.law": "sticking"}, (353, 325, 146, (131,))),
    ({"motor_heat.law": "lumped"}, (291, 270, 147, (131,))),
    ({"ecu.derating.law": "current"}, (247, 228, 136, (175,))),
    ({"drive.mode": "pedal"}, (247, 228, 136, (160,))),
    ({"drive.mode": "current"}, (247, 228, 136, (100,))),
    ({"drive.mode": "current-direct"}, (247, 228, 136, (43,))),
    ({"drive.mode": "voltage-source"}, (240, 221, 163, (11,))),
    ({"drive.mode": "current-source"}, (223, 212, 168, (11,))),
    (ALL, (320, 292, 193, (131,))),
    ({**ALL, "drive.mode": "voltage-source"}, (313, 285, 220, (11,))),
    ({**ALL, "drive.mode": "current-source"}, (296, 275, 225, (11,))),
]
WEDGE: list[tuple[dict[str, Any], Counts]] = [
    ({}, (1541, 1000, 450, (109, 98))),
    ({"screw.law": "drive", "encoder.law": "ideal"}, (1527, 986, 450, (98, 86))),
    (
        {
            "caliper.law": "table",
            **BENT,
            "flywheel.law": "driven",
            "control.offset.law": "scheduled",
        },
        (1609, 1028, 472, (109, 111)),
    ),
    (
        {"wedge_friction.stopped_disc": "stick", "command.mode": "position"},
        (1547, 1006, 450, (70,)),
    ),
    (
        {"motor_heat.law": "lumped", "control.derating.law": "current"},
        (1618, 1079, 477, (109, 158)),
    ),
    (
        {
            "adjuster.law": "screw",
            "control.adjuster.ways": "both",
            "control.adjuster.fault": "none",
        },
        (1561, 1021, 456, (114, 72, 98)),
    ),
    ({"command.mode": "current"}, (1541, 1000, 450, (8,))),  # limits the demand
]
RIGS: list[tuple[type[Model], dict[str, Any], Counts]] = [
    (ScrewRig, {}, (572, 457, 92, (67,))),
    (ScrewRig, {"rig.mode_1": "current"}, (572, 457, 92, (57,))),
    (ScrewRig, {"rig.mode_2": "current"}, (572, 457, 92, (57,))),
    (ScrewRig, {"screw.law": "drive"}, (563, 448, 92, (67,))),
    (ShaftRig, {}, (250, 224, 43, (43,))),
    (ShaftRig, {"rig.load": "dummy"}, (231, 205, 47, (43,))),
    (ShaftRig, {"rig.clamp": "closed"}, (252, 226, 43, (43,))),
    (ShaftRig, {"rig.mode_1": "current"}, (250, 224, 42, (25,))),
    (ShaftRig, {"screw.law": "drive"}, (238, 212, 43, (43,))),
    (DrivenShaft, {}, (96, 73, 0, (0,))),
    (DrivenShaft, {"rig.load": "dummy"}, (97, 74, 0, (0,))),
    (DrivenShaft, {"screw.law": "drive"}, (88, 67, 0, (0,))),
]
VEHICLES: list[tuple[type[Model], str, Counts]] = [
    (TwoWheelerByWire, "sport600", (1339, 1059, 412, (276,))),
    (TwoWheelerWholeRear, "sport600-whole-rear", (1572, 1257, 548, (276, 144))),
]
CASES = [
    *((MotorcycleBrake, "dardanelli2010", changes, counts) for changes, counts in MOTORCYCLE),
    *((WedgeBrake, "roberts2003", changes, counts) for changes, counts in WEDGE),
    *((model, "roberts2003", changes, counts) for model, changes, counts in RIGS),
    *((model, source, {}, counts) for model, source, counts in VEHICLES),
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
