"""Model descriptions of versions 2.0 and 3.0, with units as exponents of the SI base units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement

from bywire.core.quantities import display_unit
from bywire.core.units import base_powers, convert
from bywire.export.exported import (
    Exported,
    Interface,
    Kind,
    Numbered,
    Variable,
    finite_range,
    tables,
)

_BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def _unit_definitions(units: Iterable[str]) -> Element:
    """Return the element ``UnitDefinitions`` of both versions.

    A unit has bywire's display unit if the display unit is different.
    """
    made = Element("UnitDefinitions")
    for unit in sorted(set(units)):
        if unit == "1":
            continue
        shown = SubElement(made, "Unit", name=unit)
        powers = zip(_BASES, base_powers(unit, _BASES), strict=True)
        SubElement(shown, "BaseUnit", {name: str(int(power)) for name, power in powers if power})
        display = display_unit(unit)
        if display != unit and not unit.startswith("delta") and unit != "K":
            factor = 1.0 / convert(1.0, display, unit)
            SubElement(shown, "DisplayUnit", name=display, factor=repr(factor))
    return made


# --- Version 2.0

_ABLE = {
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
_OFFERED: dict[Kind, tuple[str, dict[str, str]]] = {
    "co-simulation": ("CoSimulation", {"canHandleVariableCommunicationStepSize": "true"}),
    "model-exchange": ("ModelExchange", {"completedIntegratorStepNotNeeded": "true"}),
}


def description_2(
    made: Exported,
    faces: Interface,
    identifier: str,
    token: str,
    head: dict[str, str],
    sources: Sequence[str],
) -> Element:
    """Return the model description.

    Parameters
    ----------
    identifier
        Name of the FMU's binaries.
    token
        The GUID.
    head
        Attributes that both versions share.
    sources
        Source files to compile.
    """
    frame = repr(made.schedule.frame)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "guid": token,
            "variableNamingConvention": "structured",
            "numberOfEventIndicators": str(len(faces.at("indicator"))),
            **head,
        },
    )
    offers, able = _OFFERED[faces.kind]
    offered = SubElement(root, offers, {"modelIdentifier": identifier, **_ABLE, **able})
    files = SubElement(offered, "SourceFiles")
    for name in sources:
        SubElement(files, "File", name=name)
    root.append(_unit_definitions(each.unit for each in faces.variables))
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusError"):
        SubElement(categories, "Category", name=name)
    SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime=repr(made.run.duration), stepSize=frame
    )
    variables = SubElement(root, "ModelVariables")
    for reference, each in enumerate(faces.variables):
        variables.append(_scalar(reference, each, _states_of_rates(faces).get(reference)))
    structure = SubElement(root, "ModelStructure")
    results = [k for k, each in enumerate(faces.variables) if each.causality == "output"]
    rates = _states_of_rates(faces)
    unknowns = sorted({*results, *rates, *rates.values()})
    sections = {"Outputs": results, "Derivatives": list(rates), "InitialUnknowns": unknowns}
    for section, references in sections.items():
        listed = SubElement(structure, section) if references else root
        for k in references:
            SubElement(listed, "Unknown", index=str(k + 1))
    return root


def _states_of_rates(faces: Interface) -> dict[int, int]:
    """Return the value reference of each derivative's state, by the derivative's reference.

    The integrated states come first in the state vector.
    """
    states = faces.at("state")
    return {rate: states[k] for k, rate in faces.at("rate").items()}


def _scalar(reference: int, each: Variable, state: int | None) -> Element:
    scalar = Element(
        "ScalarVariable",
        {
            "name": each.name,
            "valueReference": str(reference),
            "causality": each.causality,
            "variability": _variability(each),
            **({"description": each.label} if each.label else {}),
        },
    )
    if each.causality == "parameter":
        scalar.set("initial", "exact")
    elif each.causality != "input":
        scalar.set("initial", "calculated")
    real = SubElement(scalar, "Real")
    if state is not None:
        real.set("derivative", str(state + 1))
    for name, value in _real_attributes(each).items():
        real.set(name, value)
    return scalar


def _variability(each: Variable) -> str:
    """Return the ``variability`` of a variable: when its value may change."""
    if each.causality == "parameter":
        return "tunable" if each.is_tunable else "fixed"
    return "discrete" if each.is_held else "continuous"


def _real_attributes(each: Variable) -> dict[str, str]:
    """Return the attributes for unit, range and start of a variable, the same in both versions."""
    made = {} if each.unit == "1" else {"unit": each.unit}
    if each.leaf is not None:
        low, high = finite_range(each.leaf)
        made |= {} if low is None else {"min": repr(low)}
        made |= {} if high is None else {"max": repr(high)}
    else:
        made |= {
            name: repr(end)
            for name, end in zip(("min", "max"), each.ends, strict=True)
            if math.isfinite(end)
        }
    return made if each.start is None else made | {"start": repr(each.start)}


# --- Version 3.0: tables are arrays, tasks are clocks


def description_3(
    made: Exported, faces: Interface, identifier: str, token: str, head: dict[str, str]
) -> Element:
    """Return the model description; the arguments are those of `description_2`."""
    schedule = made.schedule
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0",
            "instantiationToken": token,
            "variableNamingConvention": "structured",
            **head,
        },
    )
    offered = {
        "modelIdentifier": identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
    }
    if faces.kind == "model-exchange":
        SubElement(root, "ModelExchange", offered)
    else:
        SubElement(
            root,
            "CoSimulation",
            {
                **offered,
                "canHandleVariableCommunicationStepSize": "true",
                "hasEventMode": "true",
                "canReturnEarlyAfterIntermediateUpdate": "false",
                "fixedInternalStepSize": repr(schedule.frame),
            },
        )
    root.append(_unit_definitions(each.unit for each in faces.variables))
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusError"):
        SubElement(categories, "Category", name=name)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(made.run.duration),
        stepSize=repr(schedule.frame),
    )
    variables = SubElement(root, "ModelVariables")
    rates = _states_of_rates(faces)
    for nodes in tables(faces):
        variables.append(_float(nodes, rates.get(nodes[0][0])))
    count = len(faces.variables)
    SubElement(
        variables,
        "Float64",
        name="time",
        valueReference=str(count),
        causality="independent",
        variability="continuous",
        description="time since the beginning of the run [s]",
    )
    if faces.part != "plant":
        for k, task in enumerate(made.run.model.tasks(made.run.par)):
            SubElement(
                variables,
                "Clock",
                name=f"clock.{task.name}",
                valueReference=str(count + 1 + k),
                causality="input",
                intervalVariability="constant",
                intervalDecimal=repr(schedule.task_frames[k] * schedule.frame),
                description=f"ticks of the task {task.name}",
            )
    structure = SubElement(root, "ModelStructure")
    results = [k for k, each in enumerate(faces.variables) if each.causality == "output"]
    sections = {
        "Output": results,
        "ContinuousStateDerivative": list(rates),
        "InitialUnknown": sorted({*results, *rates, *rates.values()}),
        "EventIndicator": list(faces.at("indicator").values()),
    }
    for section, references in sections.items():
        for reference in references:
            SubElement(structure, section, valueReference=str(reference))
    return root


def _float(nodes: list[Numbered], state: int | None) -> Element:
    reference, first = nodes[0]
    name = first.name.partition("[")[0]
    made = Element(
        "Float64",
        {
            "name": name,
            "valueReference": str(reference),
            "causality": first.causality,
            "variability": _variability(first),
            **_real_attributes(first),
            **({"description": first.label} if first.label else {}),
        },
    )
    if state is not None:
        made.set("derivative", str(state))
    if first.causality == "parameter":
        made.set("initial", "exact")
    elif first.causality != "input":
        made.set("initial", "calculated")
    if "[" in first.name:
        made.set("start", " ".join(repr(each.start) for _, each in nodes))
        SubElement(made, "Dimension", start=str(len(nodes)))
    return made


def build_description(identifier: str, sources: Sequence[str]) -> Element:
    """Return the element that describes how to compile the sources."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = SubElement(build, "SourceFileSet", language="C11")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    return root
