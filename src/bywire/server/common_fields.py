"""Fields that several forms have, and how what is typed into them is tried out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.bench.bench_file import PATHS
from bywire.core import option_texts as texts
from bywire.server.contents import Contents
from bywire.server.field import Field, Fits, is_file_name
from bywire.server.place import Place

if TYPE_CHECKING:
    from bywire.api.loop_case import LoopCase


def names(*kinds: str) -> Callable[[], Sequence[str]]:
    """Return what tells the names of some kinds of things; see `bywire.overview`."""

    def known() -> Sequence[str]:
        from bywire.api.overview import overview

        things = overview().things
        return sorted({name for kind in kinds for name in things[kind]})

    return known


def path_of(name: str, place: Place) -> Path:
    """Return where a file of the folder is, from anywhere; other names stay."""
    return place.root / name if is_file_name(name) else Path(name)


def changes_of(asked: Mapping[str, Any], place: Place) -> dict[str, str]:
    """Return the changes that were asked for, files among them from anywhere."""
    return {
        key: str(place.root / value) if key.rpartition(".")[2] in PATHS else value
        for key, value in asked["set"].items()
    }


def read_bench(asked: Mapping[str, Any], place: Place) -> object:
    """Read a bench with the changes that were asked for."""
    from bywire.bench import bench_file

    return bench_file.read(path_of(asked["bench"], place), changes_of(asked, place))


def bench(hint: str = texts.TEST_BENCH, *, is_required: bool = True) -> Field:
    """Return the field of a bench."""
    known = names("experiments", "generic_experiments")
    return Field("bench", "Bench", "thing", hint, known, _benches, is_required=is_required)


def bench_changes(fits: Fits | None) -> Field:
    """Return the field of changes of a bench."""
    return Field("set", "Changes", "changes", texts.BENCH_CHANGES, fits=fits)


def case() -> Field:
    """Return the field of the run of an experiment."""
    return Field("case", "Run", hint=texts.CASE)


def mapping() -> Field:
    """Return the field of the file that says what columns mean."""
    return Field("mapping", "What the columns mean", "thing", texts.MAP, offered=_maps)


def time() -> Field:
    """Return the field of the column that holds the instants."""
    return Field("time", "Time", hint=texts.TIME)


def error_estimate() -> Field:
    """Return the field of the estimate of the error from the step."""
    return Field("error_estimate", "Estimate the error", "flag", texts.ERROR_ESTIMATE, default=1)


def loop(hint: str = texts.LOOP, *kinds: str) -> Field:
    """Return the field of a loop, or of another such kind."""
    return Field("loop", "Loop", "choice", hint, names("loops", *kinds), is_required=True)


def parameters(fits: Fits | None = None) -> Field:
    """Return the field of a parameter set."""
    return Field(
        "parameters",
        "Parameter set",
        "choice",
        texts.PARAMETERS,
        names("parameter_sets"),
        fits=fits,
    )


def changes(fits: Fits | None = None) -> Field:
    """Return the field of changes of parameters."""
    return Field("set", "Changes", "changes", texts.CHANGES, fits=fits)


def case_of(asked: Mapping[str, Any]) -> LoopCase:
    """Return a loop as it was asked for.

    Raises
    ------
    InputError
        For what does not fit.
    """
    from bywire.api.loop_case import loop_case

    return loop_case(asked["loop"], asked["parameters"], asked["at"], asked["set"])


def of_loops() -> tuple[Field, ...]:
    """Return the fields that stand first in forms of loops."""
    return (
        loop(),
        parameters(lambda asked, _: case_of({**asked, "at": "", "set": {}})),
        Field(
            "at",
            "Operating point",
            hint=texts.AT,
            fits=lambda asked, _: case_of({**asked, "set": {}}),
        ),
        changes(lambda asked, _: case_of(asked)),
    )


def side() -> Field:
    """Return the field of the side on which linear models are taken at a corner."""

    def fit(asked: Mapping[str, Any], place: Place) -> object:
        from bywire.analysis.linear.corners import read_sides

        return read_sides(asked["side"])

    return Field("side", "Side of corners", hint=texts.SIDE, fits=fit)


def frequencies() -> Field:
    """Return the field of frequencies."""

    def fit(asked: Mapping[str, Any], place: Place) -> object:
        return case_of(asked).frequencies(asked["frequencies"], 2)

    return Field("frequencies", "Frequencies", hint=texts.FREQUENCIES, fits=fit)


def over(hint: str) -> Field:
    """Return the field of a range over which a loop is looked at."""

    def fit(asked: Mapping[str, Any], place: Place) -> object:
        from bywire.api.loop_case import over_range

        return over_range(asked["over"], case_of(asked))

    return Field("over", "Range", hint=hint, fits=fit)


def _benches(there: Contents) -> Sequence[str]:
    return list(there.benches)


def _maps(there: Contents) -> Sequence[str]:
    return there.maps
