"""The model description of version 2.0."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from bywire.export.exported import Exported
from bywire.export.fmu.units import unit_definitions
from bywire.export.interface import Interface, Kind
from bywire.export.variables import Variable, finite_range

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
        Name of the binaries, a name of C.
    token
        The GUID.
    head
        Attributes that both versions share.
    sources
        Files to compile.
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
    root.append(unit_definitions(each.unit for each in faces.variables))
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusError"):
        SubElement(categories, "Category", name=name)
    SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime=repr(made.run.duration), stepSize=frame
    )
    variables = SubElement(root, "ModelVariables")
    for reference, each in enumerate(faces.variables):
        variables.append(_scalar(reference, each, states_of_rates(faces).get(reference)))
    structure = SubElement(root, "ModelStructure")
    results = [k for k, each in enumerate(faces.variables) if each.causality == "output"]
    rates = states_of_rates(faces)
    unknowns = sorted({*results, *rates, *rates.values()})
    sections = {"Outputs": results, "Derivatives": list(rates), "InitialUnknowns": unknowns}
    for section, references in sections.items():
        listed = SubElement(structure, section) if references else root
        for k in references:
            SubElement(listed, "Unknown", index=str(k + 1))
    return root


def states_of_rates(faces: Interface) -> dict[int, int]:
    """Return the value reference of the state of each derivative, by that of the derivative.

    The states that are integrated stand first in the state vector.
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
            "variability": variability(each),
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
    for name, value in real_attributes(each).items():
        real.set(name, value)
    return scalar


def variability(each: Variable) -> str:
    """Return when a variable may change."""
    if each.causality == "parameter":
        return "tunable" if each.is_tunable else "fixed"
    return "discrete" if each.is_held else "continuous"


def real_attributes(each: Variable) -> dict[str, str]:
    """Return unit, range and start of a variable, as both versions write them."""
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
