"""What ``bywire list NAME`` shows of assemblies, experiments, loops, plants: their signals."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bywire.analysis.linear.corners import ABOVE, taking
from bywire.analysis.linear.plant import PLANTS, Plant
from bywire.analysis.loop import LOOPS, Loop
from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.model import ASSEMBLIES
from bywire.core.quantities import display_unit
from bywire.core.signals import merged_signals, places_of, signals_of
from bywire.identification.method import METHODS
from bywire.report.wording import unit_text
from bywire.synthesis.study import STUDIES

Object = dict[str, Any]


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
