"""Write the generated pages: ``python docs/make_notation.py``, after their contents changed.

``notation.md`` leads to symbols, names, units and meanings of parameters and signals;
``bench-reference.md`` has experiments with their options, stimuli and key figures. Everything
comes from the code's own metadata, and a test compares.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
import typing
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from bywire import control, plant
from bywire.analysis.loop import LOOPS, PLANTS
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.families import FAMILIES
from bywire.bench.stimulus import STIMULI
from bywire.brakes.wedge import elements, laws
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import Leaf, ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.signals import merged_signals, places_of
from bywire.report.wording import amount, range_text, unit_text

HERE = Path(__file__).parent
NOTE = "<!-- Written by docs/make_notation.py: change the listed code, not this page. -->"
GREEK = (
    "alpha",
    "beta",
    "gamma",
    "delta",
    "epsilon",
    "eta",
    "theta",
    "mu",
    "nu",
    "psi",
    "rho",
    "sigma",
    "tau",
    "omega",
    "zeta",
)
# Heads of names with another symbol in the literature.
SYMBOLS = {
    "omega": r"\Omega",
    "duty": "D",
    "torque": "T",
    "voltage": "v",
    "force": "F",
    "current": "i",
    "friction": "T_{fr}",
    "Re": r"\mathrm{Re}",
}
DERIVED = ("Factors", "Balance", "InputRate")  # tuples of derivatives: same names, other units


def symbol(name: str) -> str:
    """Return the symbol of a name, ``f_cfr_p`` as $f_{cfr,p}$; empty for a name that is a word."""
    head, *rest = name.split(".")[-1].split("_")
    if head in SYMBOLS:
        head = SYMBOLS[head]
    elif head in GREEK:
        head = f"\\{head}"
    elif len(head) == 2 and head[1].isdigit():
        head, rest = head[0], [head[1], *rest]
    elif len(head) > 1:
        return ""
    if rest == ["star"]:
        return f"${head}^*$"
    return f"${head}_{{{','.join(rest)}}}$" if rest else f"${head}$"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a Markdown table without its empty columns."""
    content = [tuple(row) for row in rows]
    titles = tuple(head)
    kept = [k for k in range(len(titles)) if any(row[k] for row in content)]
    lines = ["| " + " | ".join(titles[k] for k in kept) + " |", "|---" * len(kept) + "|"]
    for row in content:
        lines.append("| " + " | ".join(row[k].replace("|", "\\|") for k in kept) + " |")
    return [*lines, ""]


def parameter_rows(
    cls: type[ParameterSet], defaults: Mapping[str, Any] | None = None, prefix: str = ""
) -> Iterator[tuple[str, ...]]:
    """Yield symbol, name, unit, default, range and meaning of numbers and choices."""
    leaves, notes = leaf_fields(cls), field_notes(cls)
    for name, info in cls.model_fields.items():
        dotted = f"{prefix}{name}"
        kind = info.annotation
        if isinstance(kind, type) and issubclass(kind, ParameterSet):
            yield from parameter_rows(kind, defaults, f"{dotted}.")
            continue
        default = "" if defaults is None else shown(defaults[dotted], "1")
        leaf = leaves.get(name)
        if leaf is None:
            known = ("true", "false") if kind is bool else typing.get_args(kind)
            choices = ", ".join(f"`{c}`" for c in known)
            yield "", f"`{dotted}`", "", default, choices, notes[name]
            continue
        limits = interval(leaf)
        if defaults is not None:
            default = shown(defaults[dotted], leaf.unit.symbol)
            limits = range_text(leaf, defaults[dotted])
        unit = unit_text(leaf.unit.symbol) or "1"
        yield symbol(dotted), f"`{dotted}`", unit, default, limits, notes[name]


def interval(leaf: Leaf) -> str:
    """Return the valid range in the unit shown beside it."""
    low = "" if math.isinf(leaf.low) else f"{'>' if leaf.low_open else '>='} {leaf.low:g}"
    high = "" if math.isinf(leaf.high) else f"{'<' if leaf.high_open else '<='} {leaf.high:g}"
    return ", ".join(part for part in (low, high) if part)


def shown(value: Any, unit: str) -> str:
    """Return a default as a bench file writes it."""
    if isinstance(value, tuple):
        return ", ".join(shown(v, unit) for v in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else amount(value, unit, 6)


def bracketed(unit: str) -> str:
    """Return a unit in brackets, as after a name; nothing for a pure number."""
    return f" [{unit_text(display_unit(unit))}]" if unit != "1" else ""


def modules(package: Any) -> Iterator[Any]:
    """Yield the modules of a package."""
    for module in pkgutil.iter_modules(package.__path__):
        yield importlib.import_module(f"{package.__name__}.{module.name}")


def models() -> Iterator[Any]:
    """Yield every complete model among the assemblies."""
    yield from ASSEMBLIES.all().values()


def sets(model: Any) -> list[Any]:
    """Return the parameter sets of a model."""
    return [each for each in PARAMETER_SETS.all().values() if each.assembly == model.name]


def element_tuples() -> Iterator[tuple[str, type]]:
    """Yield the signal tuples of all elements and control laws, with their element."""
    for package in (plant, control, elements, laws):
        for module in modules(package):
            for value in vars(module).values():
                is_local = isinstance(value, type) and value.__module__ == module.__name__
                if is_local and issubclass(value, tuple) and value.__name__ not in DERIVED:
                    yield module.__name__.rpartition(".")[2], value


def merged(tuples: Iterable[tuple[str, Any]]) -> list[tuple[str, ...]]:
    """Return one row per name, unit and meaning, with all its places."""
    return [
        (symbol(name), f"`{name}`", unit_text(s.unit) or "1", s.label, ", ".join(where))
        for name, s, where in merged_signals(tuples)
    ]


def notation() -> str:
    """Return the page that leads to the pages of symbols."""
    rows = [
        (f"[{model.name}](notation/{model.name}.md)", ", ".join(f"`{e.name}`" for e in sets(model)))
        for model in models()
    ]
    rows += [("[elements and control laws](notation/elements.md)", "")]
    lines = [
        "# Notation",
        "",
        NOTE,
        "",
        "The tables list symbol, name in the code, unit and meaning. The code uses SI units and",
        "radians. Bench files accept any compatible unit. A name that is a word has no symbol.",
        "",
        "For signs, see [sign-conventions.md](sign-conventions.md).",
        "",
        *table(("parameters and signals of", "parameter sets"), rows),
        "```{toctree}",
        ":hidden:",
        "",
        *(f"notation/{model.name}" for model in models()),
        "notation/elements",
        "```",
        "",
    ]
    return "\n".join(lines)


def notation_of_model(model: Any) -> str:
    """Return the page of symbols of an assembly."""
    lines = [f"# Notation of {model.name}", "", NOTE, ""]
    known = sets(model)
    if known:
        names = ", ".join(f"`{e.name}`" for e in known)
        lines += ["## Parameters", "", f"Parameter sets: {names}.", ""]
        titles = ("symbol", "name", "unit", "", "range or choices", "meaning")
        lines += table(titles, parameter_rows(known[0].parameter_class))
    lines += ["## Signals", ""]
    if not known:
        lines += ["This is a rig. It uses the parameters of the tested brake.", ""]
    rows = merged(places_of(model).items())
    lines += table(("symbol", "name", "unit", "meaning", "where"), rows)
    return "\n".join(lines)


def notation_of_elements() -> str:
    """Return the page of symbols of elements and control laws."""
    lines = ["# Notation of elements and control laws", "", NOTE, ""]
    lines += table(("symbol", "name", "unit", "meaning", "element"), merged(element_tuples()))
    return "\n".join(lines)


def bench_reference() -> str:
    """Return the page of experiments, stimuli and key figures."""
    lines = [
        "# Experiments, stimuli, key figures",
        "",
        NOTE,
        "",
        "This page lists the names for [bench files](bench-files.md).",
        "",
        "## Experiments",
        "",
    ]
    titles = ("", "option", "", "default", "range or choices", "meaning")
    for e in EXPERIMENTS.all().values():
        driven = ", with a `[stimulus]`" if e.driven_unit else ""
        summary = e.summary[0].upper() + e.summary[1:]
        lines += [f"### {e.name}", "", f"{summary}. For a {e.assembly}{driven}.", ""]
        rows = [("", *row[1:]) for row in parameter_rows(e.options, e.defaults.flat())]
        lines += table(titles, ((*row[:2], "", *row[3:]) for row in rows))
        figures = (f"`{name}`{bracketed(unit)}" for name, unit in e.kpis.items())
        lines += [f"Key figures: {', '.join(figures)}.", ""]
    lines += [
        "## Generic experiments",
        "",
        "These experiments work with any brake. Options select signals by name. A unit such as "
        "`input` or `output` means the unit of the signal that the option with this name selects. "
        "By default, levels are multiples of the signal's nominal magnitude.",
        "",
    ]
    for g in GENERIC_EXPERIMENTS.all().values():
        summary = g.summary[0].upper() + g.summary[1:]
        lines += [f"### {g.name} (any brake)", "", f"{summary}.", ""]
        rows = [("", *row[1:3], "", *row[4:]) for row in parameter_rows(g.options)]
        lines += table(("", "option", "unit", "", "range or choices", "meaning"), rows)
    lines += [
        "## Loops",
        "",
        "Loops for `linearize`, `margins`, `frequency-response`, `agreement` and `design`.",
        "",
    ]
    rows = (
        (
            f"`{loop.name}`",
            loop.summary,
            loop.assembly,
            f"{loop.at.name} [{unit_text(loop.at.unit)}]",
            ", ".join(f"`{name}`" for name in loop.inputs),
            f"`{loop.output}`",
            f"`{loop.cut}`",
        )
        for loop in LOOPS.all().values()
    )
    lines += table(("loop", "meaning", "of", "at", "from", "to", "cut at"), rows)
    lines += ["## Plants", "", "Additional models for `linearize`.", ""]
    rows = (
        (
            f"`{plant.name}`",
            plant.summary,
            plant.assembly,
            ", ".join(f"{q.name} [{unit_text(q.unit)}]" for q in plant.at),
            f"{plant.band:g} Hz",
        )
        for plant in PLANTS.all().values()
    )
    lines += table(("plant", "meaning", "of", "at one of", "compared up to"), rows)
    lines += ["## Stimuli", "", "`level` is the unit of the experiment's input.", ""]
    for s in STIMULI.all().values():
        lines += [f"### {s.name}", "", s.summary, ""]
        rows = (("", *row[1:3], "", *row[4:]) for row in parameter_rows(s.parameter_class))
        lines += table(("", "parameter", "unit", "", "range or choices", "meaning"), rows)
    lines += ["## Key figures", ""]
    titles = ("name", "meaning", "family")
    known = (
        (f"`{m.name}`", m.definition, family.name)
        for family in FAMILIES.all().values()
        for m in family.measures.values()
    )
    lines += table(titles, known)
    return "\n".join(lines)


PAGES = {
    "notation.md": notation,
    **{f"notation/{model.name}.md": partial(notation_of_model, model) for model in models()},
    "notation/elements.md": notation_of_elements,
    "bench-reference.md": bench_reference,
}

if __name__ == "__main__":
    for file, page in PAGES.items():
        (HERE / file).parent.mkdir(exist_ok=True)
        (HERE / file).write_text(page(), encoding="utf-8")
