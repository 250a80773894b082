"""What a bench changes: of its parameter set, of its experiment's options, of what drives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from bywire.bench.bench import Bench
from bywire.bench.bench_file import flattened
from bywire.bench.option_names import OPTION
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.provenance import Cited
from bywire.report.tables import Table, text_table, value_text

_ABSENT = "the experiment's own"


@dataclass(frozen=True)
class Change:
    """A value that is not what it would be without being set.

    Parameters
    ----------
    name
        What ``--set`` calls it.
    now, before
        Both values as text with unit.
    where
        Where the value before comes from.
    """

    name: str
    now: str
    before: str
    where: str = ""


def parameter_changes(bench: Bench) -> list[Change]:
    """Return the parameters that differ from those of the cited set, in its order."""
    cited = PARAMETER_SETS.find(bench.parameters)
    return [
        replace(each, where=_origin(cited.values.get(each.name)))
        for each in _changes(bench.par, cited.parameters().flat())
    ]


def option_changes(bench: Bench) -> list[Change]:
    """Return the experiment's options that are not what they follow from, and what drives it."""
    chosen = bench.definition
    following = {} if chosen.following is None else chosen.following(bench.par)
    changes = _changes(
        bench.chosen_options, chosen.defaults.replace(following).flat(), OPTION,
        f"default of {chosen.name}",
    )  # fmt: skip
    driven = [
        Change(f"stimulus.{name}", str(value), _ABSENT)
        for name, value in flattened(bench.stimulus).items()
    ]
    return changes + driven


def change_table(changes: list[Change]) -> Table:
    """Return changes as a table: name, both values, where the one before comes from."""
    return text_table(
        ("changed", "value", "instead of", "which comes from"),
        [(each.name, each.now, each.before, each.where or "-") for each in changes],
    )


def _origin(cited: Cited | None) -> str:
    return "" if cited is None else ", ".join(filter(None, (cited.kind, cited.where)))


def _changes(
    now: ParameterSet, before: Mapping[str, object], prefix: str = "", where: str = ""
) -> list[Change]:
    leaves, values = leaf_fields(type(now)), now.flat()
    units = {name: leaves[name].unit.symbol if name in leaves else "1" for name in values}
    return [
        Change(
            prefix + name, value_text(value, units[name]),
            value_text(before.get(name), units[name]), where,
        )
        for name, value in values.items() if value != before.get(name)
    ]  # fmt: skip
