"""The bench file with identified parameters, and what has to be said of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.report.identification_report import Identification

_FAR = 30.0  # times: beyond, a unit is the first suspect


def bench_text(one: Identification, par: ParameterSet, changes: Mapping[str, Any]) -> str:
    """Return the text of the bench file; failed checks are said at its top.

    Parameters
    ----------
    one
        What was identified.
    par
        Parameters of the set, for units.
    changes
        What was changed beforehand, by dotted name.
    """
    from bywire.identification.parameter_file import parameter_file

    assert one.subject is not None
    lines = [f"CHECK FAILED, do not use it as it is: {c.name} = {c.value:.4g} "
             f"(limit {'>=' if c.at_least else '<='} {c.limit:g}): {c.note}"
             for c in one.found.checks if not c.holds]  # fmt: skip
    lines.append(f"identified by {one.method.name} from {one.source}")
    for estimate in one.found.estimates.values():
        lines += [f"not told by the data: {k.unknown.label}" for k in estimate.kept]
        lines += [f"lies at its bound: {label}" for label in estimate.at_bounds()]
    lines += [one.method.bench_note] if one.method.bench_note else []
    if one.method.bench is not None:
        from bywire.bench import bench_text as written

        return written.bench_text(
            one.method.bench.with_overrides(one.found.parameters), "\n".join(lines)
        )
    return parameter_file(
        one.method.experiment, one.subject.parameters, par,
        {**changes, **one.found.parameters}, "\n".join(lines),
    )  # fmt: skip


def bench_notes(one: Identification) -> list[str]:
    """Return what the user should know of the bench file, or why there is none."""
    if one.found.parameters and one.subject is not None:
        return [f"parameters.toml: {one.method.bench_note}"] if one.method.bench_note else []
    asked = one.subject is not None and one.method.unknowns
    reason = (
        "no estimate is fit for use" if asked
        else f"{one.method.name} gives no parameters of an assembly; take its figures from "
        "estimate.json"
    )  # fmt: skip
    return [f"no parameters.toml is written: {reason}"]


def far_off(found: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Return a note for every parameter that is far from what it was, as by a wrong unit."""
    notes = []
    for name, value in found.items():
        known = before.get(name, 0.0)
        ratio = abs(value / known) if known else 1.0
        if ratio > _FAR or ratio * _FAR < 1.0:
            notes.append(
                f"{name} is {ratio:.3g} times what it was before: are the units of the "
                "measurement right (the map's 'unit')?"
            )
    return notes
