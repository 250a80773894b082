"""Subject of an analysis: parameters, the user's changes, and common sections of reports."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

from bywire.bench.bench import Bench
from bywire.bench.bench_file import flattened
from bywire.bench.changes import OPTION
from bywire.bench.experiment import error_text
from bywire.bench.generic_experiment import experiment_of
from bywire.core.catalog import PARAMETER_SETS, Cited
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet, field_notes, leaf_fields
from bywire.report.document import Change, Details, Paragraph, Section, TableBlock
from bywire.report.tables import ParameterRow, parameter_table, text_table, value_text
from bywire.report.wording import range_text

_OVERRIDDEN = "override"
"""provenance of a value that differs from the published one"""


def parameter_rows(
    parameters: ParameterSet, provenance: Mapping[str, Cited] | None = None
) -> list[ParameterRow]:
    """Return one row per value of a parameter set, in its order.

    Parameters
    ----------
    parameters
        Values in use.
    provenance
        Published values by dotted name; a value that differs is marked as an override, with the
        published value.
    """
    leaves = leaf_fields(type(parameters))
    notes = field_notes(type(parameters))
    rows = []
    for name, value in parameters.flat().items():
        leaf = leaves.get(name)
        kind, where = _origin((provenance or {}).get(name), value)
        rows.append(
            ParameterRow(
                name=name,
                value=value,
                unit="1" if leaf is None else leaf.unit.symbol,
                range=notes[name] if leaf is None else range_text(leaf, value),
                kind=kind,
                where=where,
            )
        )
    return rows


def _origin(cited: Cited | None, value: object) -> tuple[str, str]:
    """Return kind and place of a value's source."""
    if cited is None:
        return "", ""
    if cited.value != value:
        origin = ", ".join(filter(None, (cited.kind, cited.where)))
        return _OVERRIDDEN, f"cited: {cited.value} in SI ({origin})"
    return cited.kind, cited.where


# --- Changes: of a parameter set, of an experiment's options and stimulus, of the run

_OWN = "the experiment's own"
_UNSET = "not set"
_SIMULATION = {"step": "s", "record": "s", "seed": "1", "engine": "1"}
"""unit of each setting of a run, by its name in [simulation]"""


def bench_changes(bench: Bench) -> tuple[Change, ...]:
    """Return all settings of a bench that differ from its source and its experiment."""
    return (
        *_set_changes(bench.parameters, bench.par),
        *_assembly_change(bench),
        *_option_changes(bench),
        *_stimulus_changes(bench),
        *_simulation_changes(bench),
    )


def _set_changes(parameters: str, par: ParameterSet) -> tuple[Change, ...]:
    """Return the values that differ from those of a parameter set, in its order."""
    cited = PARAMETER_SETS.find(parameters)
    origins = {name: _origin_of(each) for name, each in cited.values.items()}
    return value_changes(par, cited.parameters().flat(), parameters, origins=origins)


def value_changes(
    now: ParameterSet,
    before: Mapping[str, object],
    of: str,
    prefix: str = "",
    origins: Mapping[str, str] | None = None,
) -> tuple[Change, ...]:
    """Return the values that differ from others.

    Parameters
    ----------
    now
        The values in use.
    before
        Original values, by name.
    of
        Owner of the original values (see `Change`).
    prefix
        Prefix of the names.
    origins
        Sources of the original values, by name. Default: empty.
    """
    leaves, values = leaf_fields(type(now)), now.flat()
    units = {name: leaves[name].unit.symbol if name in leaves else "1" for name in values}
    return tuple(
        Change(
            prefix + name,
            value_text(value, units[name]),
            value_text(before.get(name), units[name]),
            of,
            (origins or {}).get(name, ""),
        )
        for name, value in values.items()
        if value != before.get(name)
    )


def defaults_of(name: str) -> str:
    """Return the name of an experiment's, or a study's, default values."""
    return f"the defaults of {name}"


_ORIGINS = {
    "paper": "printed in a source",
    "derived": "derived from other values",
    "calibrated": "calibrated to match a source",
    "chosen": "chosen without a source",
}


def origins_text(parameters: str) -> str:
    """Return the number of values of a parameter set by origin.

    Raises
    ------
    UnknownNameError
        If the parameter set is unknown.
    """
    values = PARAMETER_SETS.find(parameters).values.values()
    counts = Counter(value.kind for value in values)
    parts = [f"{counts[kind]} {text}" for kind, text in _ORIGINS.items() if counts[kind]]
    return f"values of {parameters}: {', '.join(parts)} ('bywire list {parameters}' shows each)"


def origins_block(parameters: str) -> Paragraph:
    """Return the origins of the values of a parameter set as a sentence."""
    origins = origins_text(parameters)
    return Paragraph(f"{origins[0].upper()}{origins[1:]}.")


def source_block(parameters: str) -> Paragraph:
    """Return the source of a parameter set and the origins of its values."""
    source = PARAMETER_SETS.find(parameters).source
    text = f"Source of the parameters: {source}. " if source else ""
    return Paragraph(f"{text}{origins_block(parameters).text}")


def changes_block(
    changes: Sequence[Change], parameters: str, defaults: str = "", varied: Sequence[str] = ()
) -> TableBlock | Paragraph:
    """Return a table of changes, or a note that there are none.

    Parameters
    ----------
    changes
        The changes.
    parameters
        Name of the parameter set; empty for none.
    defaults
        Name of the experiment or study whose options are in use; empty for none.
    varied
        Quantities with several values.
    """
    if changes:
        rows = [(each.name, each.now, each.before, each.where or each.of) for each in changes]
        heads = ("changed", "value", "original", "source")
        return TableBlock(text_table(heads, rows), "Changes.")
    unchanged = ", ".join(
        filter(
            None,
            [
                f"all parameters are those of {parameters}" if parameters else "",
                f"all options are those of {defaults}" if defaults else "",
            ],
        )
    )
    if varied:
        return Paragraph(f"Only {', '.join(varied)} varied. Otherwise, {unchanged}.")
    return Paragraph(f"Nothing was changed: {unchanged}.")


def _assembly_change(bench: Bench) -> Iterator[Change]:
    if bench.assembly:
        own = PARAMETER_SETS.find(bench.parameters).assembly
        yield Change("assembly", bench.assembly, own, bench.parameters, "the model of the set")


def _option_changes(bench: Bench) -> Iterator[Change]:
    """Yield the options that differ from their defaults."""
    chosen = bench.definition
    following = {} if chosen.following is None else chosen.following(bench.par)
    defaults = chosen.defaults.replace(following).flat()
    of = defaults_of(chosen.name)
    yield from value_changes(bench.chosen_options, defaults, of, OPTION)
    for name, value in bench.options.items():
        if isinstance(value, str) and value == defaults.get(name):  # it may name a signal
            before = _unset(bench, name)
            if before != value:
                yield Change(OPTION + name, value, before, of)


def _unset(bench: Bench, option: str) -> str:
    """Return the default of an option that specifies a signal, with all other options set."""
    others = {name: value for name, value in bench.options.items() if name != option}
    try:
        unset = experiment_of(bench.experiment, bench.parameters, bench.assembly, others)
    except InputError:
        return _UNSET
    return str(unset.defaults.flat().get(option, _UNSET))


def _stimulus_changes(bench: Bench) -> Iterator[Change]:
    for name, value in flattened(bench.stimulus).items():
        yield Change(f"stimulus.{name}", str(value), _OWN, defaults_of(bench.experiment))


def _simulation_changes(bench: Bench) -> Iterator[Change]:
    defaults = {each.name: each.default for each in fields(Bench)}
    for name, unit in _SIMULATION.items():
        value, before = getattr(bench, name), defaults[name]
        if value not in (before, math.nan):  # NaN: no step is chosen for a stated error
            text = _OWN if before is None else value_text(before, unit)
            now = value_text(value, unit)
            yield Change(f"simulation.{name}", now, text, defaults_of("runs"))
    if bench.error is not None:
        now = error_text(float(bench.error))
        yield Change("simulation.error", now, _UNSET, defaults_of("runs"))


def _origin_of(cited: Cited) -> str:
    return ", ".join(filter(None, (cited.kind, cited.where)))


# --- Subjects


@dataclass(frozen=True)
class Subject:
    """Subject of an analysis: a loop or a brake with its parameters.

    Parameters
    ----------
    name, summary
        Name, and one line of description.
    parameters, par
        Name of the parameter set, and the values in use.
    point
        Operating point as text; empty for none.
    bench
        The analyzed bench; None if it is not a bench.
    further
        Changes outside a parameter set or a bench.
    varied
        Quantities with several values.
    """

    name: str
    summary: str
    parameters: str
    par: ParameterSet
    point: str = ""
    bench: Bench | None = None
    further: tuple[Change, ...] = ()
    varied: tuple[str, ...] = ()

    @classmethod
    def of_bench(
        cls,
        bench: Bench,
        name: str = "",
        summary: str = "",
        varied: Collection[str] = (),
        further: tuple[Change, ...] = (),
    ) -> Subject:
        """Return a bench as a subject. Default: the bench's name and summary.

        ``varied``: quantities with several values; ``further``: other changes.
        """
        return cls(
            name or bench.name or bench.experiment,
            summary or bench.summary(varied),
            bench.parameters,
            bench.par,
            bench=bench,
            varied=tuple(varied),
            further=further,
        )

    @property
    def changes(self) -> tuple[Change, ...]:
        """The user's changes."""
        if self.bench is not None:
            return (*bench_changes(self.bench), *self.further)
        return (*_set_changes(self.parameters, self.par), *self.further)

    @property
    def changes_block(self) -> TableBlock | Paragraph:
        """The table of changes, or a note that there are none."""
        defaults = "" if self.bench is None else self.bench.experiment
        return changes_block(self.changes, self.parameters, defaults, self.varied)

    @property
    def line(self) -> str:
        """The line below a report's title."""
        at = f" at {self.point}" if self.point else ""
        return f"{self.summary}{at}; parameter set {self.parameters}"

    def provenance(self, *notes: str, has_changes: bool = True) -> Section:
        """Return the section on the origin of a report: notes, changes, source, all parameters.

        ``has_changes``: whether it contains the changes, rather than an earlier section.

        Raises
        ------
        UnknownNameError
            If the parameter set is unknown.
        """
        cited = PARAMETER_SETS.find(self.parameters)
        rows = parameter_rows(self.par, cited.values)
        return Section(
            "Settings",
            [
                *map(Paragraph, filter(None, notes)),
                *([self.changes_block] if has_changes else []),
                source_block(self.parameters),
                Details("All parameters", [TableBlock(parameter_table(rows))]),
            ],
        )
