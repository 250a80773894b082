"""The model description of version 3.0: tables are arrays, tasks are clocks."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from bywire.export.exported import Exported
from bywire.export.fmu.description2 import real_attributes, states_of_rates, variability
from bywire.export.fmu.units import unit_definitions
from bywire.export.interface import Interface, Numbered, tables


def description_3(
    made: Exported, faces: Interface, identifier: str, token: str, head: dict[str, str]
) -> Element:
    """Return the model description; arguments as those of `description_2`."""
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
    root.append(unit_definitions(each.unit for each in faces.variables))
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
    rates = states_of_rates(faces)
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
            "variability": variability(first),
            **real_attributes(first),
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
    """Return how the sources are compiled."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = SubElement(build, "SourceFileSet", language="C11")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    return root
