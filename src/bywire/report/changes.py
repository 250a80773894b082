"""What a user changed: of a parameter set, of an experiment's options and stimulus, of the run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

from bywire.bench.bench import Bench
from bywire.bench.bench_file import flattened
from bywire.bench.experiment_choice import experiment_of
from bywire.bench.option_names import OPTION
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.provenance import Cited
from bywire.report.document import Change, Paragraph, TableBlock
from bywire.report.tables import text_table, value_text

_OWN = "the experiment's own"
_UNSET = "not set"
_SIMULATION = {"step": "s", "record": "s", "seed": "1", "engine": "1"}
"""unit of each setting of a run, by its name in [simulation]"""


def bench_changes(bench: Bench) -> tuple[Change, ...]:
    """Return everything that a bench sets to something else than its source and its experiment."""
    return (
        *set_changes(bench.parameters, bench.par),
        *_assembly_change(bench),
        *_option_changes(bench),
        *_stimulus_changes(bench),
        *_simulation_changes(bench),
    )


def set_changes(parameters: str, par: ParameterSet) -> tuple[Change, ...]:
    """Return the values that differ from those of a parameter set, in its order."""
    cited = PARAMETER_SETS.find(parameters)
    origins = {name: _origin(each) for name, each in cited.values.items()}
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
        What they would be, by name.
    of
        What these belong to, as `Change` has it.
    prefix
        What stands before the names.
    origins
        Where the values before come from, by name; nothing by default.
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
    """Return what the default values of an experiment, or of a study, are called."""
    return f"the defaults of {name}"


def changes_block(
    changes: Sequence[Change], parameters: str, defaults: str = "", varied: Sequence[str] = ()
) -> TableBlock | Paragraph:
    """Return a table of changes, or that there are none.

    Parameters
    ----------
    changes
        What was changed.
    parameters
        Name of the parameter set; empty where there is none.
    defaults
        Name of the experiment or study whose options are in use; empty where there are none.
    varied
        Quantities that take several values.
    """
    if changes:
        rows = [(each.name, each.now, each.before, each.where or each.of) for each in changes]
        heads = ("changed", "value", "instead of", "source")
        return TableBlock(text_table(heads, rows), "What was changed.")
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
        return Paragraph(f"Only {', '.join(varied)} varied; apart from that, {unchanged}.")
    return Paragraph(f"Nothing was changed: {unchanged}.")


def _assembly_change(bench: Bench) -> Iterator[Change]:
    if bench.assembly:
        own = PARAMETER_SETS.find(bench.parameters).assembly
        yield Change("assembly", bench.assembly, own, bench.parameters, "the model of the set")


def _option_changes(bench: Bench) -> Iterator[Change]:
    """Yield the options that are not what they would be without being set."""
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
    """Return what an option that names a signal would be if it alone were not set."""
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
        if value != before:
            text = _OWN if before is None else value_text(before, unit)
            now = value_text(value, unit)
            yield Change(f"simulation.{name}", now, text, defaults_of("runs"))


def _origin(cited: Cited) -> str:
    return ", ".join(filter(None, (cited.kind, cited.where)))
