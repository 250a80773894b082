"""Kinds of named things: their names, summaries and descriptions."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple, get_args, get_origin

import numpy as np

from bywire.analysis.linear.corners import ABOVE, taking
from bywire.analysis.loop import LOOPS, PLANTS, Loop, Plant
from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.bench.faults.modes import Mode, modes_of
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, GenericExperiment
from bywire.bench.kpis.families import definitions
from bywire.bench.stimulus import STIMULI, StimulusKind
from bywire.campaigns.residual import CAMPAIGNS, RESIDUALS, DeclaredCampaign, Residual
from bywire.contracts.elements import Element, elements_by_name, every_element, parameter_classes
from bywire.core.brake import brakes, loaded_files
from bywire.core.catalog import PARAMETER_SETS, CitedSet, main_set
from bywire.core.errors import unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import Leaf, ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.registry import Kind
from bywire.core.signals import merged_signals, places_of, signals_of
from bywire.identification.method import METHODS, Method
from bywire.identification.question import BENCH_METHODS, BenchMethod
from bywire.life.declaration import LIVES, Life
from bywire.report.tables import value_text
from bywire.report.wording import amount, range_text, readable_units, unit_beside, unit_text
from bywire.synthesis.study import STUDIES, Study

Object = dict[str, Any]


def _summary(thing: Any) -> str:
    return str(thing.summary)


def _with_assembly(thing: Any) -> str:
    assemblies = (thing.assembly, *getattr(thing, "variants", ()))
    return f"{thing.summary} ({', '.join(assemblies)})"


class ThingKind(NamedTuple):
    """A kind of named things.

    Parameters
    ----------
    title
        Noun for a thing of this kind.
    things
        All things of this kind by name.
    describe
        Function that describes a thing as plain data with a ``summary``. None if its line is
        enough.
    topic
        Topic under which the index lists the things. Empty if there are too many to list.
    line
        Function that returns a thing's line in the index.
    listed
        Things that the index lists. Default: all.
    meaning
        Function that returns the text to search. None if the search skips this kind.
    has_assembly
        Whether each thing belongs to an assembly whose description lists it.
    """

    title: str
    things: Callable[[], Mapping[str, Any]]
    describe: Callable[[Any], Object] | None = None
    topic: str = ""
    line: Callable[[Any], str] = _summary
    listed: Callable[[], Mapping[str, Any]] | None = None
    meaning: Callable[[Any], str] | None = None
    has_assembly: bool = False


def thing_kinds() -> tuple[ThingKind, ...]:
    """Return all kinds in the index's order, with parameters, their groups and signals last."""
    return (
        ThingKind("brake", _brakes, None, "brakes"),
        ThingKind(
            "assembly",
            ASSEMBLIES.all,
            _system,
            "assemblies",
            system_summary,
            listed=_assemblies_with_numbers,
            meaning=system_summary,
        ),
        ThingKind(
            "parameter set",
            partial(_in_order, PARAMETER_SETS),
            _parameter_set,
            "parameter_sets",
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind(
            "experiment",
            partial(_in_order, EXPERIMENTS),
            _experiment,
            "experiments",
            _with_assembly,
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind(
            "generic experiment",
            GENERIC_EXPERIMENTS.all,
            _generic_experiment,
            "generic_experiments",
            lambda experiment: f"{experiment.summary} (any brake)",
            meaning=_summary,
        ),
        ThingKind("element", elements_by_name, _element, "elements", listed=every_element),
        ThingKind(
            "loop",
            partial(_in_order, LOOPS),
            _loop,
            "loops",
            _with_assembly,
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind(
            "plant",
            partial(_in_order, PLANTS),
            _plant,
            "plants",
            _with_assembly,
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind(
            "study",
            partial(_in_order, STUDIES),
            _study,
            "studies",
            _with_assembly,
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind("life", partial(_in_order, LIVES), _life, "lives"),
        ThingKind(
            "method",
            partial(_in_order, METHODS),
            _method,
            "methods",
            _method_line,
            meaning=_summary,
            has_assembly=True,
        ),
        ThingKind(
            "method of any bench",
            BENCH_METHODS.all,
            _bench_method,
            "methods",
            lambda method: f"{method.summary} (any brake, with --bench)",
            meaning=_summary,
        ),
        ThingKind("stimulus", STIMULI.all, _stimulus, "stimuli", meaning=_summary),
        ThingKind("fault", faults, _fault, "faults", _fault_line),
        ThingKind("campaign", CAMPAIGNS.all, _campaign, "campaigns"),
        ThingKind("residual", RESIDUALS.all, None, "residuals", _residual_line),
        ThingKind(
            "KPI",
            definitions,
            _kpi,
            "kpis",
            lambda kpi: kpi.definition,
            meaning=lambda kpi: kpi.definition,
        ),
        ThingKind("parameter", lambda: {name: name for name in _parameters()}, _parameter),
        ThingKind("parameter group", lambda: {name: name for name in _groups()}, _group),
        ThingKind("signal", signals, _signal),
    )


def all_things() -> dict[str, Any]:
    """Return topic -> name -> line as plain data, with things of brakes loaded by path first.

    Assemblies have no lines. The key figure names of every experiment are at the end.
    """
    topics: dict[str, Any] = {}
    for kind in thing_kinds():
        if kind.topic:
            things = (kind.listed or kind.things)()
            lines = {name: kind.line(thing) for name, thing in things.items()}
            topics.setdefault(kind.topic, {}).update(lines)
    topics["assemblies"] = sorted(topics["assemblies"])
    kpis = {name: dict(each.kpis) for name, each in _in_order(EXPERIMENTS).items()}
    return {**topics, "kpis_of_experiments": kpis}


def doubts() -> list[str]:
    """Return a warning for every parameter set whose assembly no brake declares."""
    known = ASSEMBLIES.all()
    texts = []
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly not in known:
            file, line = PARAMETER_SETS.place(cited.name)
            nearest = unknown_name("assembly", cited.assembly, known)
            texts.append(
                f"{file}, line {line}: parameter set {cited.name!r} belongs to an assembly that no "
                f"brake declares: {nearest}"
            )
    return texts


def _in_order(kind: Kind[Any]) -> Mapping[str, Any]:
    """Return all things of a kind, with those of brakes loaded by path first."""
    files = loaded_files()
    loaded = [brake for brake in brakes().values() if brake.file in files]
    first = {name: thing for brake in loaded for name, thing in kind.of(brake.module).items()}
    return {**first, **kind.all()}


def _brakes() -> Mapping[str, Any]:
    files = loaded_files()
    known = sorted(brakes().values(), key=lambda brake: brake.file not in files)
    return {brake.name: brake for brake in known}


def _assemblies_with_numbers() -> Mapping[str, Any]:
    """Return the assemblies with a parameter set, and all assemblies of a brake without one."""
    known = ASSEMBLIES.all()
    named = {cited.assembly for cited in PARAMETER_SETS.all().values()}
    names = named & known.keys()
    for brake in brakes().values():
        declared = ASSEMBLIES.of(brake.module).keys()
        names |= declared if declared.isdisjoint(named) else set()
    return {name: known[name] for name in names}


# --- Faults


def faults() -> dict[str, list[tuple[str, Mode]]]:
    """Return every mode by name, each with the assemblies that have it.

    Those of brakes loaded by path come first.
    """
    every: dict[str, list[tuple[str, Mode]]] = {}
    seen = set()
    for cited in _in_order(PARAMETER_SETS).values():
        if cited.assembly in seen or cited.assembly not in ASSEMBLIES.all():
            continue
        seen.add(cited.assembly)
        model = ASSEMBLIES.all()[cited.assembly]()
        for name, mode in modes_of(model, cited.parameters()).items():
            every.setdefault(name, []).append((cited.assembly, mode))
    return every


def _fault_line(places: list[tuple[str, Mode]]) -> str:
    return f"{places[0][1].summary} ({', '.join(assembly for assembly, _ in places)})"


def _fault(places: list[tuple[str, Mode]]) -> dict[str, Any]:
    """Return a mode's details, with its value's unit and default in every assembly."""
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
        "see": f'injected by [[faults]] in a bench file, or --fault "{name}'
        + ("=VALUE" if places[0][1].unit else "")
        + '@ONSET"',
    }


def _residual_line(residual: Residual) -> str:
    unit = unit_text(display_unit(residual.unit)) or "-"
    return f"{residual.summary} [{unit}] ({', '.join(residual.assemblies)})"


def _campaign(campaign: DeclaredCampaign) -> Object:
    criteria = [
        {"name": each["name"], "signal": each["signal"]} for each in campaign.content["criteria"]
    ]
    return {
        "summary": campaign.summary,
        "experiment": campaign.content["bench"],
        "signals": criteria,
        "see": f"run it with 'bywire faults {campaign.name}', which lists its faults, criteria and "
        "residuals",
    }


# --- Parameters and options


def _parameters() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every parameter by dotted name."""
    holders: dict[str, tuple[str, ...]] = {}
    for assembly in sorted({e.assembly for e in PARAMETER_SETS.all().values()}):
        for name in field_notes(PARAMETER_SETS.find(main_set(assembly)).parameter_class):
            holders[name] = (*holders.get(name, ()), assembly)
    return holders


def _groups() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every group of parameters, such as ``motor``, by name."""
    holders: dict[str, tuple[str, ...]] = {}
    for name, assemblies in _parameters().items():
        group = name.rpartition(".")[0]
        if group:
            holders[group] = tuple(dict.fromkeys((*holders.get(group, ()), *assemblies)))
    return holders


def _parameter(name: str) -> Object:
    """Return unit, range and meaning of a parameter, and its value in every set."""
    assemblies, values = _parameters()[name], []
    descriptions: dict[str, list[str]] = {"meaning": [], "unit": [], "range": []}
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly in assemblies:
            rows = _option_rows(cited.parameter_class, cited.parameters())
            (row,) = (row for row in rows if row["name"] == name)
            values.append({"parameter set": cited.name, "value": row["value"]})
            for key, texts in descriptions.items():
                is_other = key == "range" and cited.name != main_set(cited.assembly)
                texts += [] if is_other or row[key] in texts else [row[key]]
    merged = {key: " or ".join(filter(None, texts)) for key, texts in descriptions.items()}
    return {
        "summary": merged["meaning"],
        "assembly": ", ".join(assemblies),
        "unit": merged["unit"],
        "range": merged["range"],
        "values": values,
        "see": f"change it with --set {name}=VALUE",
    }


def _group(name: str) -> Object:
    """Return the parameters of a group, with the values of each assembly's main set."""
    assemblies = _groups()[name]
    rows, sets, meanings = [], [], []
    for assembly in assemblies:
        cited = PARAMETER_SETS.find(main_set(assembly))
        sets.append(cited.name)
        meanings.append(group_meaning(_class_of(cited.parameter_class, name)))
        new = [
            row
            for row in _option_rows(cited.parameter_class, cited.parameters())
            if row["name"].rpartition(".")[0] == name
        ]
        if len(assemblies) > 1:
            new = [{**row, "meaning": f"{row['meaning']} ({assembly})".strip()} for row in new]
        rows += new
    about = " or ".join(dict.fromkeys(filter(None, meanings)))
    return {
        "summary": f"{about} (values from {' and '.join(sets)})",
        "assembly": ", ".join(assemblies),
        "parameters": rows,
        "changed_with": "--set NAME=VALUE",
    }


def group_meaning(cls: type[ParameterSet]) -> str:
    """Return the meaning of a parameter group, from its element's module or its class."""
    about = inspect.getdoc(cls) or ""
    if cls.__name__ == "Parameters":
        about = getattr(inspect.getmodule(cls), "__doc__", None) or about
    return " ".join(about.strip().partition("\n\n")[0].split()).rstrip(".")


def _class_of(cls: type[Any], name: str) -> type[Any]:
    for part in name.split("."):
        cls = cls.model_fields[part].annotation
    return cls


def _option_rows(
    cls: type[ParameterSet],
    values: ParameterSet | Mapping[str, Any] | None,
    simulated: Collection[str] = (),
) -> list[dict[str, Any]]:
    """Return a row for every number and choice of a parameter class, in declared order.

    Parameters
    ----------
    cls
        The class.
    values
        Default values. If None, those of the class.
    simulated
        Prefixes of the names of options that affect only simulated experiments.
    """
    leaves, notes = leaf_fields(cls), field_notes(cls)
    known = _given_by(cls) if values is None else values
    if isinstance(known, ParameterSet):
        known = known.flat()
    rows = []
    for name in notes:
        leaf = leaves.get(name)
        unit = "1" if leaf is None else leaf.unit.symbol
        meaning = " ".join(notes[name].split()).replace("``", "")
        if name.split(".")[0] in simulated and "synthetic" not in meaning:
            meaning += " (simulated experiments)"
        rows.append(
            {
                "name": name,
                "value": value_text(known[name], unit) if name in known else None,
                "unit": "" if leaf is None else display_unit(unit),
                "range": _choices(cls, name) if leaf is None else _range(leaf, known.get(name)),
                "meaning": meaning,
            }
        )
    return rows


def _given_by(cls: type[ParameterSet]) -> Mapping[str, Any]:
    """Return the default values of a class by name."""
    fields = cls.model_fields.items()
    return {name: info.default for name, info in fields if not info.is_required()}


_PLACES = {
    "input": "the input's unit",
    "output": "the output's unit",
    "level": "the signal's unit",
    "friction": "the velocity's unit",
    "along": "the state's unit",
}
"""units of levels without a signal yet, in generic experiments and stimuli"""


def _range(leaf: Leaf, value: object) -> str:
    """Return a valid range in the unit of the value beside it."""
    place, _, per = leaf.unit.symbol.partition("/")
    if place in _PLACES:
        numbers = range_text(leaf).replace(f" {leaf.unit.symbol}", "")
        return f"{numbers}, in {_PLACES[place]}{per and f' per {per}'}"
    bounded = math.isfinite(leaf.low) or math.isfinite(leaf.high)
    symbol = leaf.unit.symbol
    unit = unit_text(unit_beside(value, symbol) or display_unit(symbol))
    return range_text(leaf, value) + ("" if bounded or not unit else f" in {unit}")


def _choices(cls: type[ParameterSet], name: str) -> str:
    """Return the valid values of a choice."""
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


def _parameter_set(cited: CitedSet) -> Object:
    rows = _option_rows(cited.parameter_class, cited.parameters())
    for row in rows:
        known = cited.values.get(row["name"])
        parts = () if known is None else (known.kind, known.where)
        row["provenance"] = ": ".join(part for part in parts if part)
    return {
        "summary": cited.summary,
        "assembly": cited.assembly,
        "source": cited.source,
        "parameters": rows,
        "changed_with": "--set NAME=VALUE",
    }


# --- Systems: their signals


def signals() -> Mapping[str, Sequence[Object]]:
    """Return every signal by name, with its systems, units, meanings and places."""
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


def _signal(rows: Sequence[Object]) -> Object:
    return {"summary": rows[0]["meaning"], "found in": rows}


def _system(model: type[Any]) -> Object:
    """Return an assembly, or a rig, with its signals and the things that belong to it."""
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
        kind.topic.replace("_", " "): ", ".join(
            name
            for name, thing in kind.things().items()
            if model.name in (thing.assembly, *getattr(thing, "variants", ()))
        )
        for kind in thing_kinds()
        if kind.has_assembly
    }
    parameters = "'bywire list NAME' also shows the parameters of a parameter set"
    return {
        "summary": system_summary(model),
        **there,
        "signals": rows,
        "see": parameters if there["parameter sets"] else "",
    }


def system_summary(model: type[Any]) -> str:
    """Return a one-line summary of a model."""
    # The class's docstring states its purpose. The file's docstring describes the model.
    about = inspect.getmodule(model).__doc__ or ""
    return " ".join(about.strip().partition("\n\n")[0].split()).rstrip(".")


def _drive(experiment: Experiment) -> Object:
    """Return the signals that an experiment drives, with their systems."""
    if experiment.driven_unit is not None:
        unit = display_unit(experiment.driven_unit(experiment.defaults))
        row = {
            "signal": "[stimulus]",
            "unit": unit,
            "meaning": "stimulus from this section of the bench file",
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
    """Return the commands that list the recorded signals."""
    commands = " and ".join(f"'bywire list {name}'" for name in ran)
    return f"{commands} {'shows' if len(ran) == 1 else 'show'} the recorded signals" if ran else ""


def _driven(case: Case) -> list[tuple[str, str, str]]:
    known = signals_of(case.model.Stimulus)
    return [
        (name, display_unit(known[name].unit), known[name].label)
        for name in known
        if name in case.stimulus(np.zeros(1))
    ]


# --- Experiments, stimuli and key figures


def _experiment(experiment: Experiment) -> Object:
    return {
        "summary": experiment.summary,
        "assembly": ", ".join((experiment.assembly, *experiment.variants)),
        **_drive(experiment),
        "kpis": [{"name": n, "unit": readable_units(u)} for n, u in experiment.kpis.items()],
        "options": _option_rows(experiment.options, experiment.defaults),
        "changed_with": "--set options.NAME=VALUE",
    }


def _generic_experiment(experiment: GenericExperiment) -> Object:
    rows = _option_rows(experiment.options, experiment.defaults)
    for row in rows:
        value = experiment.defaults.get(row["name"])
        row["value"] = None if value is None else _default(value, row["unit"], experiment)
    return {
        "summary": experiment.summary,
        "assembly": "any",
        "options": rows,
        "changed_with": "--set options.NAME=VALUE",
        "see": "'bywire list NAME' also shows the stimuli and recorded signals of an assembly. "
        f"'x nominal' multiplies the nominal value of the signal that {_named(experiment)} selects",
    }


def _default(value: Any, unit: str, experiment: GenericExperiment) -> str:
    if any(option in unit for option in experiment.signals):  # the unit is that of a signal
        values = value if isinstance(value, tuple) else (value,)
        return ", ".join(f"{v:g} x nominal" if v else "0" for v in values)
    return value_text(value, unit)


def _named(experiment: GenericExperiment) -> str:
    *first, last = experiment.signals
    return f"option {', '.join(first)} or {last}" if first else f"option {last}"


def _stimulus(stimulus: StimulusKind) -> Object:
    return {"summary": stimulus.summary, "parameters": _option_rows(stimulus.parameter_class, None)}


def _kpi(kpi: Any) -> Object:
    """Return a key figure's meaning, its unit, and the experiments that have it."""
    experiments = {e.name: e.kpis for e in EXPERIMENTS.all().values() if kpi.name in e.kpis}
    units = sorted({kpis[kpi.name] for kpis in experiments.values()})
    return {
        "summary": kpi.definition,
        **({"details": details} if (details := _details(kpi)) else {}),
        "unit": readable_units(*units) if units else "",
        "experiments": ", ".join(experiments),
    }


def _details(kpi: Any) -> str:
    """Return how a key figure is computed, on one line, without formulas."""
    _, *rest = inspect.cleandoc(kpi.__doc__ or "").split("\n\n")
    told = [" ".join(part.split()) for part in rest if not part.startswith((".. ", " "))]
    return " ".join(told).replace("`", "")


# --- Loops, plants and elements


def _loop(loop: Loop) -> Object:
    """Return a loop with its inputs, output, states, cut and operating point."""
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
        "assembly": ", ".join((loop.assembly, *loop.variants)),
        "system": model.name,
        "at": at,
        "signals": rows,
    }


def _plant(plant: Plant) -> Object:
    """Return a plant with its inputs, outputs and states."""
    par = PARAMETER_SETS.find(main_set(plant.assembly)).parameters()
    with taking(ABOVE):  # signal names do not depend on the side
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


def _element(element: Element) -> Object:
    parts = [*element.functions, *(cls.__name__ for cls in parameter_classes(element.module))]
    return {
        "summary": element.summary,
        "source": element.module.__file__ or element.name,
        "parts": ", ".join(parts),
        "see": f"'bywire check {element.name}' tests it",
    }


# --- Methods, studies and lives


def _method_line(method: Method) -> str:
    signals = ", ".join(
        f"{name} [{unit_text(unit) or '-'}]" if unit else name
        for name, unit in method.signals.items()
    )
    return f"{method.summary}; needs {signals} ({method.assembly or 'any brake'})"


def _method(method: Method) -> Object:
    needed = [{"signal": n, "unit": u or "any", "needed": "yes"} for n, u in method.signals.items()]
    more = [{"signal": n, "unit": u or "any", "needed": "no"} for n, u in method.optional.items()]
    return {
        "summary": method.summary,
        "assembly": method.assembly or "any",
        "experiment": method.experiment,
        "records": "one or more" if method.several else "one",
        "signals": [*needed, *more],
        "estimates": _estimates(method),
        "options": _option_rows(method.options, method.defaults, method.simulated),
        "changed_with": "--option NAME=VALUE",
    }


def _bench_method(method: BenchMethod) -> Object:
    return {
        "summary": method.summary,
        "assembly": "any, from --bench",
        "records": "one or more",
        "options": _option_rows(method.options, method.defaults, method.simulated),
        "changed_with": "--option NAME=VALUE",
        "see": "'bywire list NAME' shows names for --input (stimulus), --output (recording) and "
        "--estimate-start (state), where NAME is the bench's assembly. For a parameter set, "
        "it shows names for --unknown",
    }


def _estimates(method: Method) -> list[Object]:
    """Return the names that a method estimates, with parameters of the assembly first."""
    rows = []
    if method.assembly and method.unknowns:
        cls = PARAMETER_SETS.find(main_set(method.assembly)).parameter_class
        leaves, notes = leaf_fields(cls), field_notes(cls)
        rows += [
            {"name": n, "unit": display_unit(leaves[n].unit.symbol), "meaning": notes[n]}
            for n in method.unknowns
            if n in leaves
        ]
    return rows + [
        {"name": n, "unit": display_unit(unit) or "any", "meaning": text}
        for n, (unit, text) in method.further.items()
    ]


def _study(study: Study) -> Object:
    return {
        "summary": study.summary,
        "assembly": study.assembly,
        "options": _option_rows(study.options, study.defaults),
        "changed_with": "--set NAME=VALUE",
    }


def _life(life: Life) -> Object:
    rows = _option_rows(life.wear, life.defaults())
    return {
        "summary": life.summary,
        "experiment": life.experiment,
        "options": rows,
        "changed_with": "--set wear.NAME=VALUE",
    }
