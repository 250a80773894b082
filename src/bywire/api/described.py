"""What ``bywire list NAME`` shows: of parameters and options, of systems, of what may fail."""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import numpy as np

from bywire.analysis.linear.corners import ABOVE, taking
from bywire.analysis.loop import LOOPS, PLANTS, Loop, Plant
from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.bench.faults.modes import Mode, modes_of
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import Leaf, ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.signals import merged_signals, places_of, signals_of
from bywire.identification.method import METHODS
from bywire.report.wording import amount, unit_text
from bywire.synthesis.study import STUDIES

if TYPE_CHECKING:
    from bywire.report.tables import Table


def faults() -> dict[str, list[tuple[str, Mode]]]:
    """Return every mode by name, each with the assemblies that have it."""
    every: dict[str, list[tuple[str, Mode]]] = {}
    seen = set()
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly in seen or cited.assembly not in ASSEMBLIES.all():
            continue
        seen.add(cited.assembly)
        model = ASSEMBLIES.all()[cited.assembly]()
        for name, mode in modes_of(model, cited.parameters()).items():
            every.setdefault(name, []).append((cited.assembly, mode))
    return every


def fault_summaries() -> dict[str, str]:
    """Return a line on every mode: what happens, and in which assemblies."""
    return {
        name: f"{places[0][1].summary} ({', '.join(assembly for assembly, _ in places)})"
        for name, places in faults().items()
    }


def described_fault(places: list[tuple[str, Mode]]) -> dict[str, Any]:
    """Return all about a mode: its value's unit and default in every assembly."""
    rows = [
        {
            "assembly": assembly,
            "value": amount(mode.value, mode.unit) if mode.unit else "none",
            "unit": display_unit(mode.unit) if mode.unit else "",
        }
        for assembly, mode in places
    ]
    name = places[0][1].name
    return {
        "summary": places[0][1].summary,
        "found in": rows,
        "see": f'put in by [[faults]] of a bench file, or --fault "{name}'
        + ("=VALUE" if places[0][1].unit else "")
        + '@ONSET"',
    }


# --- Parameters and options

Object = dict[str, Any]


def parameters() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every parameter by dotted name."""
    holders: dict[str, tuple[str, ...]] = {}
    for assembly in sorted({e.assembly for e in PARAMETER_SETS.all().values()}):
        for name in field_notes(PARAMETER_SETS.find(main_set(assembly)).parameter_class):
            holders[name] = (*holders.get(name, ()), assembly)
    return holders


def groups() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every group of parameters, such as ``motor``, by name."""
    holders: dict[str, tuple[str, ...]] = {}
    for name, assemblies in parameters().items():
        group = name.rpartition(".")[0]
        if group:
            holders[group] = tuple(dict.fromkeys((*holders.get(group, ()), *assemblies)))
    return holders


def described_parameter(name: str) -> Object:
    """Return unit, range and meaning of a parameter, and its value in every set."""
    assemblies, values = parameters()[name], []
    descriptions: dict[str, list[str]] = {"meaning": [], "unit": [], "range": []}
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly in assemblies:
            rows = option_rows(cited.parameter_class, cited.parameters())
            (row,) = (row for row in rows if row["name"] == name)
            values.append({"parameter set": cited.name, "value": row["value"]})
            for key, texts in descriptions.items():
                texts += [] if row[key] in texts else [row[key]]
    said = {key: " or ".join(filter(None, texts)) for key, texts in descriptions.items()}
    return {
        "summary": said["meaning"],
        "assembly": ", ".join(assemblies),
        "unit": said["unit"],
        "range": said["range"],
        "values": values,
        "see": f"changed with --set {name}=VALUE",
    }


def described_group(name: str) -> Object:
    """Return the parameters of a group, with the values of each assembly's main set."""
    assemblies = groups()[name]
    rows, sets, meanings = [], [], []
    for assembly in assemblies:
        cited = PARAMETER_SETS.find(main_set(assembly))
        sets.append(cited.name)
        meanings.append(group_meaning(_class_of(cited.parameter_class, name)))
        new = [
            row
            for row in option_rows(cited.parameter_class, cited.parameters())
            if row["name"].rpartition(".")[0] == name
        ]
        if len(assemblies) > 1:
            new = [{**row, "meaning": f"{row['meaning']} ({assembly})".strip()} for row in new]
        rows += new
    about = " or ".join(dict.fromkeys(filter(None, meanings)))
    return {
        "summary": f"{about}; parameters with the values of {' and '.join(sets)}",
        "assembly": ", ".join(assemblies),
        "parameters": rows,
        "changed_with": "--set NAME=VALUE",
    }


def group_meaning(cls: type[ParameterSet]) -> str:
    """Return what a group of parameters is of: an element's module says it, else the class."""
    about = inspect.getdoc(cls) or ""
    if cls.__name__ == "Parameters":
        about = getattr(inspect.getmodule(cls), "__doc__", None) or about
    return " ".join(about.strip().partition("\n\n")[0].split()).rstrip(".")


def _class_of(cls: type[Any], name: str) -> type[Any]:
    for part in name.split("."):
        cls = cls.model_fields[part].annotation
    return cls


def described_kpi(name: str, definition: str) -> Object:
    """Return a key figure's meaning, its unit, and the experiments that tell it."""
    from bywire.report.wording import readable_units

    known = {e.name: e.kpis[name] for e in EXPERIMENTS.all().values() if name in e.kpis}
    units = sorted({readable_units(unit) for unit in known.values()})
    return {"summary": definition, "unit": " or ".join(units), "experiments": ", ".join(known)}


def option_rows(
    cls: type[ParameterSet], values: ParameterSet | None, simulated: Collection[str] = ()
) -> list[dict[str, Any]]:
    """Return a row for every number and choice of a parameter class, in their order.

    Parameters
    ----------
    cls
        The class.
    values
        What is taken unless something else is given; None where the class alone says so.
    simulated
        First parts of the names of those that only shape simulated experiments.
    """
    from bywire.report.tables import value_text

    leaves, notes = leaf_fields(cls), field_notes(cls)
    known: Mapping[str, Any] = _given_by(cls) if values is None else values.flat()
    rows = []
    for name in notes:
        leaf = leaves.get(name)
        unit = "1" if leaf is None else leaf.unit.symbol
        meaning = " ".join(notes[name].split())
        if name.split(".")[0] in simulated and "synthetic" not in meaning:
            meaning += " (simulated experiments)"
        rows.append(
            {
                "name": name,
                "value": value_text(known[name], unit) if name in known else None,
                "unit": "" if leaf is None else display_unit(unit),
                "range": _choices(cls, name) if leaf is None else _range(leaf),
                "meaning": meaning,
            }
        )
    return rows


def _given_by(cls: type[ParameterSet]) -> Mapping[str, Any]:
    """Return what a class takes where nothing is given, by name."""
    fields = cls.model_fields.items()
    return {name: info.default for name, info in fields if not info.is_required()}


def option_table(rows: Sequence[Mapping[str, Any]], heading: str) -> Table:
    """Return these rows as a table whose values stand under a heading."""
    from bywire.report.tables import text_table

    columns = ["name", "value", "range", "meaning"]
    if all(row["value"] is None for row in rows):
        columns.remove("value")
    if any(row.get("provenance") for row in rows):
        columns.append("provenance")
    titles = [heading if name == "value" else name for name in columns]
    return text_table(titles, [[row.get(name) or "-" for name in columns] for row in rows])


_PLACES = {"input": "the input", "output": "the output", "level": "the signal"}
"""units of levels that belong to no signal yet: of generic experiments, and of stimuli"""


def _range(leaf: Leaf) -> str:
    from bywire.report.wording import range_text, unit_text

    place, _, per = leaf.unit.symbol.partition("/")
    if place in _PLACES:
        numbers = range_text(leaf).replace(f" {leaf.unit.symbol}", "")
        return f"{numbers} in the unit of {_PLACES[place]}{per and f' per {per}'}"
    bounded = math.isfinite(leaf.low) or math.isfinite(leaf.high)
    unit = unit_text(display_unit(leaf.unit.symbol))
    return range_text(leaf) + ("" if bounded or not unit else f" in {unit}")


def _choices(cls: type[ParameterSet], name: str) -> str:
    """Return what a choice may be."""
    *groups, last = name.split(".")
    for group in groups:
        cls = cls.model_fields[group].annotation  # type: ignore[assignment]
    annotation = cls.model_fields[last].annotation
    if annotation is bool:
        return "true or false"
    if get_origin(annotation) is not Literal:
        return "-"
    *first, end = map(str, get_args(annotation))
    return f"{', '.join(first)} or {end}" if first else end


# --- Systems: their signals


def signals() -> Mapping[str, Sequence[Object]]:
    """Return every signal of a system by name: in which systems, with unit, meaning and place."""
    places: dict[str, list[Object]] = {}
    for system, model in ASSEMBLIES.all().items():
        for name, signal, where in merged_signals(places_of(model).items()):
            places.setdefault(name, []).append(
                {
                    "system": system,
                    "unit": display_unit(signal.unit),
                    "meaning": signal.label,
                    "where": ", ".join(where),
                }
            )
    return places


def described_system(model: type[Any]) -> Object:
    """Return an assembly, or a rig, with its signals and what there is for it."""
    kinds: Mapping[str, Mapping[str, Any]] = {
        "parameter sets": PARAMETER_SETS.all(),
        "experiments": EXPERIMENTS.all(),
        "loops": LOOPS.all(),
        "plants": PLANTS.all(),
        "studies": STUDIES.all(),
        "methods": METHODS.all(),
    }
    rows = [
        {
            "signal": name,
            "unit": display_unit(signal.unit),
            "meaning": signal.label,
            "where": ", ".join(where),
        }
        for name, signal, where in merged_signals(places_of(model).items())
    ]
    there = {
        kind: ", ".join(n for n, entry in known.items() if entry.assembly == model.name)
        for kind, known in kinds.items()
    }
    shown = "'bywire list' with the name of a parameter set shows its parameters"
    return {
        "summary": system_summary(model),
        **there,
        "signals": rows,
        "see": shown if there["parameter sets"] else "",
    }


def system_summary(model: type[Any]) -> str:
    """Return what a model is in a line."""
    # The class says what it is for; what it is stands at the head of its file.
    about = inspect.getmodule(model).__doc__ or ""
    return " ".join(about.strip().partition("\n\n")[0].split()).rstrip(".")


def described_drive(experiment: Experiment) -> Object:
    """Return which signals an experiment drives, of which systems."""
    if experiment.driven_unit is not None:
        unit = display_unit(experiment.driven_unit(experiment.defaults))
        row = {
            "signal": "[stimulus]",
            "unit": unit,
            "meaning": "what this section of the bench file gives",
            "system": experiment.assembly,
        }
        return {"drives": [row], "see": _recorded([experiment.assembly])}
    par = PARAMETER_SETS.find(main_set(experiment.assembly)).parameters()
    rows: dict[tuple[str, str], Object] = {}
    for case in (experiment.preview or experiment.cases)(par, experiment.defaults, None):
        for name, unit, label in _driven(case):
            key = name, case.model.name
            rows[key] = {"signal": name, "unit": unit, "meaning": label, "system": key[1]}
    ran = list(dict.fromkeys(system for _, system in rows))
    return {"drives": list(rows.values()), "see": _recorded(ran)}


def _recorded(ran: Sequence[str]) -> str:
    """Return where the signals of what ran are shown."""
    commands = " and ".join(f"'bywire list {name}'" for name in ran)
    return f"{commands}: the signals that a recording holds" if ran else ""


def _driven(case: Case) -> list[tuple[str, str, str]]:
    known = signals_of(case.model.Stimulus)
    return [
        (name, display_unit(known[name].unit), known[name].label)
        for name in known
        if name in case.stimulus(np.zeros(1))
    ]


def described_loop(loop: Loop) -> Object:
    """Return a loop with its inputs, output, states, and where it is cut and looked at."""
    par = loop.smooth(PARAMETER_SETS.find(main_set(loop.assembly)).parameters())
    model = loop.point(par, loop.at.default).model
    known = {name: (s.unit, s.label) for name, s, _ in merged_signals(places_of(model).items())}
    parts = {
        "input": loop.inputs,
        "output": (loop.output,),
        "cut open at": (loop.cut,),
        "state": tuple(model.State._fields),
    }
    rows = [
        {
            "signal": name,
            "unit": display_unit(known.get(name, ("1", ""))[0]),
            "meaning": known.get(name, ("1", ""))[1],
            "as": part,
        }
        for part, names in parts.items()
        for name in names
    ]
    at = f"{loop.at.name} [{unit_text(display_unit(loop.at.unit))}]"
    return {
        "summary": loop.summary,
        "assembly": loop.assembly,
        "system": model.name,
        "at": at,
        "signals": rows,
    }


def described_plant(plant: Plant) -> Object:
    """Return a plant with its inputs, outputs and states."""
    par = PARAMETER_SETS.find(main_set(plant.assembly)).parameters()
    with taking(ABOVE):  # names of signals are those of any side
        model = plant.model(par, plant.usual)
    places = places_of(ASSEMBLIES.all()[plant.assembly]).items()
    meaning = {name: signal.label for name, signal, _ in merged_signals(places)}
    parts = (
        ("input", model.inputs, model.input_units),
        ("output", model.outputs, model.output_units),
        ("state", model.states, model.state_units),
    )
    rows = [
        {"signal": name, "unit": display_unit(unit), "meaning": meaning.get(name, ""), "as": part}
        for part, names, units in parts
        for name, unit in zip(names, units, strict=True)
    ]
    at = " or ".join(f"{q.name} [{unit_text(display_unit(q.unit))}]" for q in plant.at)
    return {"summary": plant.summary, "assembly": plant.assembly, "at": at, "signals": rows}
