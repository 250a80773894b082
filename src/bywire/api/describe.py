"""All about a name: a method, an experiment, a signal; and everything that mentions a word."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

from bywire.analysis.loop import LOOPS, PLANTS
from bywire.api.described import (
    described_drive,
    described_fault,
    described_group,
    described_kpi,
    described_loop,
    described_parameter,
    described_plant,
    described_system,
    faults,
    group_meaning,
    groups,
    option_rows,
    option_table,
    parameters,
    signals,
    system_summary,
)
from bywire.bench.experiment import EXPERIMENTS, Experiment
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, GenericExperiment
from bywire.bench.kpis.families import definitions
from bywire.bench.stimulus import STIMULI, StimulusKind
from bywire.campaigns.residual import CAMPAIGNS, DeclaredCampaign
from bywire.contracts.elements import Element, elements_by_name, parameter_classes
from bywire.core.arguments import checked
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.catalog import CitedSet as Set
from bywire.core.errors import UnknownNameError, quoted, unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import display_unit
from bywire.identification.method import METHODS, Method
from bywire.identification.question import BENCH_METHODS, BenchMethod
from bywire.life.declaration import LIVES, Life
from bywire.report.answer import Answer
from bywire.report.document import Document, Flat, Paragraph, Section, TableBlock
from bywire.report.tables import text_table
from bywire.report.wording import readable_units, unit_text
from bywire.synthesis.study import STUDIES, Study

_SHOWN = 12  # rows on a terminal
_WORD = re.compile(r"[^\W\d_]{2,}|\w+")


class Mention(NamedTuple):
    """Something with a name, and what is declared of it."""

    kind: str
    name: str
    meaning: str
    unit: str = ""


@dataclass(frozen=True)
class Mentioned(Answer):
    """What mentions some words that are no name.

    Parameters
    ----------
    words
        What was asked for.
    mentions
        What mentions them, what is called so first.
    """

    words: str
    mentions: tuple[Mention, ...]

    def document(self) -> Document:
        """Return kind, name and meaning of each; on a terminal of as many as a screen holds."""
        rows = [(mention.kind, mention.name, mention.meaning) for mention in self.mentions]
        more = len(rows) - _SHOWN
        table, start = (
            text_table(("kind", "name", "meaning"), each) for each in (rows, rows[:_SHOWN])
        )
        left = [f"and {more} more: ask with more words"] if more > 0 else []
        head = f"nothing is called {quoted(self.words)}; it is mentioned by"
        return Document(
            self.words,
            head,
            sections=[Section("Mentioned by", [TableBlock(table)])],
            brief=[head, TableBlock(start, width=0), *left],
            data={
                "name": self.words,
                "found": [
                    {"kind": kind, "name": name, "summary": meaning, "unit": unit}
                    for kind, name, meaning, unit in self.mentions
                ],
            },
            has_files=False,
        )


def mentions(words: str) -> list[Mention]:
    """Return everything that mentions all of some words, what is called so first.

    A word is found at the beginning of a declared one, in names, meanings (docstrings, labels,
    summaries) and, as a whole, units.
    """
    asked = [word.lower() for word in _WORD.findall(words)]
    known = dict.fromkeys(_known()) if asked else {}
    return sorted(
        (mention for mention in known if all(_says(mention, word) for word in asked)),
        key=lambda mention: not all(_begins(mention.name, word) for word in asked),
    )


def nearest_words(name: str) -> Sequence[str]:
    """Return the declared words that are nearest to one that nothing mentions."""
    words = {word for mention in _known() for word in _WORD.findall(mention.meaning)}
    return get_close_matches(name, [word for word in words if len(word) > 3], n=2, cutoff=0.75)


def _says(mention: Mention, word: str) -> bool:
    whole = mention.unit.lower(), mention.name.lower()
    return word in whole or _begins(f"{mention.name} {mention.meaning}", word)


def _begins(text: str, word: str) -> bool:
    return any(each.lower().startswith(word) for each in _WORD.findall(text))


def _known() -> Iterator[Mention]:
    """Yield everything that has a name; groups of parameters first, which say what is where."""
    assemblies = dict.fromkeys(each.assembly for each in PARAMETER_SETS.all().values())
    classes = [PARAMETER_SETS.find(main_set(name)).parameter_class for name in assemblies]
    for cls in classes:
        yield from _groups(cls)
    for cls in classes:
        leaves = leaf_fields(cls)
        for name, note in field_notes(cls).items():
            unit = display_unit(leaves[name].unit.symbol) if name in leaves else ""
            yield Mention("parameter", name, " ".join(note.split()), unit)
    for name, rows in signals().items():
        yield Mention("signal", name, str(rows[0]["meaning"]), str(rows[0]["unit"]))
    for name, model in ASSEMBLIES.all().items():
        yield Mention("assembly", name, system_summary(model))
    kinds: dict[str, tuple[Any, ...]] = {
        "parameter set": (PARAMETER_SETS,),
        "experiment": (EXPERIMENTS, GENERIC_EXPERIMENTS),
        "loop": (LOOPS,),
        "plant": (PLANTS,),
        "study": (STUDIES,),
        "method": (METHODS, BENCH_METHODS),
        "stimulus": (STIMULI,),
    }
    for title, several in kinds.items():
        for kind in several:
            for thing in kind.all().values():
                yield Mention(title, thing.name, thing.summary)
    for figure in definitions().values():
        yield Mention("KPI", figure.name, figure.definition)


def _groups(cls: type[ParameterSet], prefix: str = "") -> Iterator[Mention]:
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            yield Mention("parameter group", f"{prefix}{name}", group_meaning(inner))
            yield from _groups(inner, f"{prefix}{name}.")


# --- All about a name

Object = dict[str, Any]

_LINES = (
    "parts",
    "assembly",
    "system",
    "at",
    "unit",
    "range",
    "experiment",
    "records",
    "source",
    "parameter sets",
    "experiments",
    "loops",
    "plants",
    "studies",
    "methods",
)
_LONGEST = 200  # characters that are looked for
_TABLES = ("drives", "signals", "found in", "values", "estimates", "kpis")


def described(name: str) -> list[Object]:
    """Return an object for everything that has a name: a method, an experiment, both.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    kinds: Mapping[str, tuple[Mapping[str, Any], Callable[[Any], Object]]] = {
        "assembly": (ASSEMBLIES.all(), described_system),
        "method": (METHODS.all(), _method),
        "method of any bench": (BENCH_METHODS.all(), _bench_method),
        "experiment": (EXPERIMENTS.all(), _experiment),
        "experiment of any brake": (GENERIC_EXPERIMENTS.all(), _generic),
        "life": (LIVES.all(), _life),
        "study": (STUDIES.all(), _study),
        "parameter set": (PARAMETER_SETS.all(), _set),
        "loop": (LOOPS.all(), described_loop),
        "plant": (PLANTS.all(), described_plant),
        "stimulus": (STIMULI.all(), _stimulus),
        "fault": (faults(), described_fault),
        "campaign": (CAMPAIGNS.all(), _campaign),
        "KPI": (definitions(), lambda kpi: described_kpi(kpi.name, kpi.definition)),
        "parameter": ({n: n for n in parameters()}, described_parameter),
        "parameter group": ({n: n for n in groups()}, described_group),
        "element": (elements_by_name(), _element),
        "signal": (signals(), lambda rows: {"summary": rows[0]["meaning"], "found in": rows}),
    }
    objects: list[Object] = [
        {"kind": kind, "name": name, **describe(known[name])}
        for kind, (known, describe) in kinds.items()
        if name in known
    ]
    if not objects:
        names = {n for known, _ in kinds.values() for n in known}
        raise unknown_name("name", name, names.union(nearest_words(name)))
    return objects


@dataclass(frozen=True)
class Description(Answer):
    """Everything of a name, as plain data: an object for each kind of thing that has it."""

    name: str
    objects: tuple[Object, ...]

    def document(self) -> Document:
        """Return lines and tables of each."""
        blocks = [_blocks(thing) for thing in self.objects]
        titles = [f"{thing['kind']} {thing['name']}" for thing in self.objects]
        spaced = [part for k, each in enumerate(blocks) for part in ([""] * (k > 0) + each)]
        return Document(
            self.name,
            "; ".join(str(thing["summary"]) for thing in self.objects),
            sections=[
                Section(title, [Paragraph(b) if isinstance(b, str) else b for b in each])
                for title, each in zip(titles, blocks, strict=True)
            ],
            brief=spaced,
            data={"name": self.name, "found": list(self.objects)},
            has_files=False,
        )


@checked
def describe(name: str) -> Description | Mentioned:
    """Return all about something of the list, a parameter, a group of them, or a signal.

    Of words that are no name, everything whose declared meaning mentions them.

    Parameters
    ----------
    name
        Name of an assembly, element, experiment, loop, plant, study, method, parameter set,
        stimulus, key figure, parameter (``"motor.R_m"``), group of parameters, or signal; or
        words, such as ``"battery"``.

    Returns
    -------
    Description or Mentioned
        What there is of that name, or what mentions the words.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    if len(name) > _LONGEST:
        raise UnknownNameError(
            f"{quoted(name)}: a name, or a few words, of at most {_LONGEST} characters is wanted"
        )
    try:
        return Description(name, tuple(described(name)))
    except UnknownNameError:
        mentioned = mentions(name)
        if not mentioned:
            raise
        return Mentioned(name, tuple(mentioned))


def _blocks(thing: Object) -> list[str | Flat]:
    """Return an object as lines and tables, apart by empty lines."""
    lines = [f"{thing['kind']} {thing['name']}: {thing['summary']}"]
    lines += [
        f"  {key}: {unit_text(thing[key]) if key == 'unit' else thing[key]}"
        for key in _LINES
        if thing.get(key)
    ]
    blocks: list[str | Flat] = ["\n".join(lines)]
    for key in _TABLES:
        rows = thing.get(key)
        if rows:
            columns = list(rows[0])
            cells = [
                [(unit_text(row[n]) if n == "unit" else row[n]) or "-" for n in columns]
                for row in rows
            ]
            blocks += ["", key, TableBlock(text_table(columns, cells))]
    for key, heading in (("options", "default"), ("parameters", "value")):
        if thing.get(key):
            changed = f", changed with {thing['changed_with']}" if "changed_with" in thing else ""
            heading = "default" if thing["kind"] == "stimulus" else heading
            blocks += ["", f"{key}{changed}", TableBlock(option_table(thing[key], heading))]
    if thing.get("see"):
        blocks += ["", thing["see"]]
    return blocks


def _element(element: Element) -> Object:
    parts = [*element.functions, *(cls.__name__ for cls in parameter_classes(element.module))]
    return {
        "summary": element.summary,
        "source": element.module.__file__ or element.name,
        "parts": ", ".join(parts),
        "see": f"'bywire check {element.name}' puts it to the test",
    }


def _method(method: Method) -> Object:
    needed = [{"signal": n, "unit": u or "any", "needed": "yes"} for n, u in method.signals.items()]
    more = [{"signal": n, "unit": u or "any", "needed": "no"} for n, u in method.optional.items()]
    return {
        "summary": method.summary,
        "assembly": method.assembly or "any",
        "experiment": method.experiment,
        "records": "one or several" if method.several else "one",
        "signals": [*needed, *more],
        "estimates": _estimates(method),
        "options": option_rows(method.options, method.defaults, method.simulated),
        "changed_with": "--option NAME=VALUE",
    }


def _bench_method(method: BenchMethod) -> Object:
    return {
        "summary": method.summary,
        "assembly": "any, that of --bench",
        "records": "one or several",
        "options": option_rows(method.options, method.defaults, method.simulated),
        "changed_with": "--option NAME=VALUE",
        "see": "'bywire list' with the name of the bench's assembly shows what --input (stimulus), "
        "--output (recording) and --estimate-start (state) take, with a parameter's what --unknown "
        "takes",
    }


def _estimates(method: Method) -> list[Object]:
    """Return the names that a method finds, parameters of the assembly first."""
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


def _experiment(experiment: Experiment) -> Object:
    return {
        "summary": experiment.summary,
        "assembly": experiment.assembly,
        **described_drive(experiment),
        "kpis": [{"name": n, "unit": readable_units(u)} for n, u in experiment.kpis.items()],
        "options": option_rows(experiment.options, experiment.defaults),
        "changed_with": "--set options.NAME=VALUE",
    }


def _generic(experiment: GenericExperiment) -> Object:
    rows = option_rows(experiment.options, None)
    for row in rows:
        value = experiment.defaults.get(row["name"])
        row["value"] = None if value is None else _default(value, row["unit"], experiment)
    return {
        "summary": experiment.summary,
        "assembly": "any",
        "options": rows,
        "changed_with": "--set options.NAME=VALUE",
        "see": "'bywire list' with the name of an assembly shows its stimuli and what it records; "
        f"levels are multiples of what is nominal for the signal of option {_named(experiment)}",
    }


def _default(value: Any, unit: str, experiment: GenericExperiment) -> str:
    from bywire.report.tables import value_text

    if any(option in unit for option in experiment.signals):  # the unit is that of a signal
        values = value if isinstance(value, tuple) else (value,)
        return ", ".join(f"{v:g} x nominal" if v else "0" for v in values)
    return value_text(value, unit)


def _named(experiment: GenericExperiment) -> str:
    return " or ".join(experiment.signals)


def _study(study: Study) -> Object:
    return {
        **_in_short(study),
        "options": option_rows(study.options, study.defaults),
        "changed_with": "--set NAME=VALUE",
    }


def _life(life: Life) -> Object:
    rows = option_rows(life.wear, life.defaults())
    return {
        "summary": life.summary,
        "experiment": life.experiment,
        "options": rows,
        "changed_with": "--set wear.NAME=VALUE",
    }


def _set(cited: Set) -> Object:
    rows = option_rows(cited.parameter_class, cited.parameters())
    for row in rows:
        known = cited.values.get(row["name"])
        parts = () if known is None else (known.kind, known.where)
        row["provenance"] = ": ".join(part for part in parts if part)
    return {
        **_in_short(cited),
        "source": cited.source,
        "parameters": rows,
        "changed_with": "--set NAME=VALUE",
    }


def _campaign(campaign: DeclaredCampaign) -> Object:
    criteria = [
        {"name": each["name"], "signal": each["signal"]} for each in campaign.content["criteria"]
    ]
    return {
        "summary": campaign.summary,
        "experiment": campaign.content["bench"],
        "signals": criteria,
        "see": f"run by 'bywire faults {campaign.name}'; its faults, criteria and residuals are "
        "listed in the answer",
    }


def _stimulus(stimulus: StimulusKind) -> Object:
    return {"summary": stimulus.summary, "parameters": option_rows(stimulus.parameter_class, None)}


def _in_short(entry: Any) -> Object:
    return {"summary": entry.summary, "assembly": entry.assembly}
