"""Benches that differ only in numbers, set up together for the many cases of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.kpis.families import FamilyJudge
from bywire.bench.running import run_of
from bywire.core.errors import BywireError
from bywire.core.parameters import ParameterSet
from bywire.core.several import DifferError, Several
from bywire.core.typing import Array
from bywire.simulation.run import Run, put_signals, sampled_stimulus
from bywire.simulation.run_table import RunTable

_LEAST = 4  # cases: the first and the last one are also set up alone
_FIELDS = ("label", "duration", "settle", "keep", "record")


@dataclass(frozen=True)
class JoinedBenches(Sequence[Bench]):
    """Benches of one experiment with a single run, whose runs differ only in numbers and noise.

    Parameters
    ----------
    build
        ``build(k)``: one of the benches.
    like
        One of the benches.
    runs
        The run of each bench.
    """

    build: Callable[[int], Bench]
    like: Bench
    runs: RunTable

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, k: int) -> Bench: ...

    @overload
    def __getitem__(self, k: slice) -> JoinedBenches: ...

    def __getitem__(self, k: int | slice) -> Bench | JoinedBenches:
        if isinstance(k, int):
            return self.build(range(len(self))[k])
        places = range(len(self))[k]
        return JoinedBenches(lambda j: self.build(places[j]), self.like, self.runs[k])


def one_of(benches: Sequence[Bench]) -> Bench:
    """Return one of several benches of one experiment with the same choices."""
    return benches.like if isinstance(benches, JoinedBenches) else benches[0]


def options_of(benches: Sequence[Bench]) -> list[ParameterSet]:
    """Return the options of each bench."""
    if isinstance(benches, JoinedBenches):
        return [benches.like.chosen_options] * len(benches)
    return [bench.chosen_options for bench in benches]


def is_plain(bench: Bench) -> bool:
    """Return whether an experiment makes one run and adds nothing to its recording."""
    definition = bench.definition
    return definition.static is None and definition.finish is None and len(bench.cases()) == 1


def in_groups(
    bench: Bench,
    columns: Mapping[str, NDArray[Any]],
    seeds: Sequence[int],
    build: Callable[[int], Bench],
) -> Iterator[tuple[NDArray[np.int64], JoinedBenches | None]]:
    """Yield groups of cases, with their benches if they can be joined; see `join`."""
    is_possible = (
        isinstance(bench.definition.judge, FamilyJudge)
        and is_plain(bench)
        and not bench.faults
        and all(column.dtype == np.float64 for column in columns.values())
        and columns.keys() <= bench.par.leaves().keys()
    )
    waiting = [np.arange(len(seeds))]
    while waiting:
        places = waiting.pop()
        benches, where = None, None
        if is_possible and len(places) >= _LEAST:
            try:
                benches = _joined_at(places, bench, columns, seeds, build)
            except DifferError as error:
                where = error.where
        if where is None or where.all() or not where.any():
            yield places, benches
        else:
            waiting += [places[~where], places[where]]


def _joined_at(
    places: NDArray[np.int64],
    bench: Bench,
    columns: Mapping[str, Array],
    seeds: Sequence[int],
    build: Callable[[int], Bench],
) -> JoinedBenches:
    """Return the joined benches of some cases."""
    each = {name: column[places] for name, column in columns.items()}
    own = places.tolist()
    return join(bench, each, [seeds[k] for k in own], lambda k: build(own[k]))


def join(
    bench: Bench,
    columns: Mapping[str, Array],
    seeds: Sequence[int],
    build: Callable[[int], Bench],
) -> JoinedBenches:
    """Return benches with other parameters, which the experiment sets up only once.

    The experiment computes with the numbers of all cases at a time (`bywire.core.several`). The
    first and the last bench are also set up alone, and must agree bit for bit.

    Parameters
    ----------
    bench
        The bench without changes.
    columns
        Value of each changed parameter in each case [SI], shape (cases,), by dotted name.
    seeds
        Seed of each case.
    build
        ``build(k)``: one of the benches, set up alone.

    Raises
    ------
    DifferError
        When a case is invalid, or when the cases must be set up separately.
    """
    try:
        with np.errstate(all="ignore"):
            (case,) = bench.joined(columns).cases()
        ends = {k: build(k) for k in (0, len(seeds) - 1)}
        runs = {k: _run(each) for k, each in ends.items()}
        table = _table(case, seeds, runs[0], lambda k: runs[k] if k in runs else _run(build(k)))
        sampled_stimulus(runs[0], runs[0].schedule())  # rejects invalid values
        for k, run in runs.items():
            _require_equal(case, ends[k].cases()[0], run, table, k)
    except DifferError:
        raise
    except (BywireError, ArithmeticError, AttributeError, TypeError, ValueError) as error:
        raise DifferError(f"the cases must be set up separately ({error})") from None
    return JoinedBenches(lambda k: ends[k] if k in ends else build(k), ends[0], table)


def _run(bench: Bench) -> Run:
    return run_of(bench, bench.cases()[0], 0)


def _table(
    case: Case,
    seeds: Sequence[int],
    like: Run,
    build: Callable[[int], Run],
) -> RunTable:
    """Return the runs of joined cases; ``like``: the first of them."""
    count, values = len(seeds), case.par.value
    noise = getattr(like.stimulus, "noise")  # noqa: B009 - bench runs have it
    schedule = like.schedule()
    stimulus = np.zeros((schedule.stimulus_rows, len(case.model.Stimulus._fields)))
    given = case.stimulus(schedule.stimulus_times - case.settle)
    for k, name in enumerate(case.model.Stimulus._fields):
        if name in given and k not in noise.columns:
            stimulus[:, k] = given[name]
    numbers = [(seed, *noise.seed[1:]) for seed in seeds]
    return RunTable(
        like,
        _column_wise([values(name) for name in like.par.leaves()], count),
        _column_wise(case.state, count),
        _column_wise(case.memory, count),
        stimulus,
        np.array(numbers, dtype=np.uint64),
        noise.columns,
        build,
    )


def _column_wise(numbers: Sequence[Any], count: int) -> Array:
    """Return numbers of several cases as a table, shape (cases, numbers)."""
    table = np.empty((count, len(numbers)))
    for k, number in enumerate(numbers):
        table[:, k] = number.values if isinstance(number, Several) else number
    return table


def _require_equal(case: Case, alone: Case, run: Run, table: RunTable, k: int) -> None:
    """Require that a joined case is bit-identical to the same case alone.

    Raises
    ------
    DifferError
        When they differ.
    """
    rows = np.zeros(table.stimulus.shape)
    put_signals(rows, run, run.schedule().stimulus_times)
    pairs = (
        (table.parameters[k], list(run.par.leaves().values())),
        (table.states[k], run.state),
        (table.memories[k], run.memory),
        (table.stimulus, rows),
    )
    is_equal = (
        type(case) is type(alone) is Case
        and all(getattr(case, name) == getattr(alone, name) for name in _FIELDS)
        and run.schedule() == table.like.schedule()
        and run.par.has_choices_of(table.like.par)
        and all(_equal(joined, single) for joined, single in pairs)
    )
    if not is_equal:
        raise DifferError("the cases are different when they are set up together")


def _equal(joined: Array, single: Any) -> bool:
    """Return whether numbers are bit-identical."""
    numbers: NDArray[np.float64] = np.array(single, dtype=float)
    return joined.shape == numbers.shape and joined.tobytes() == numbers.tobytes()
