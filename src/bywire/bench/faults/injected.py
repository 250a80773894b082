"""Faults in a run: taps in its model, corrupted signals, and changed parameters."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import combinations
from typing import Any

import numpy as np

from bywire.bench.experiment import Case, FaultyCase
from bywire.bench.faults.fault_section import MOST, Course, Injection, injections
from bywire.bench.faults.modes import Mode, corrupt, missed
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.simulation.tapped import Tap, Tapped, rests


def checked_sections(sections: Any) -> list[dict[str, Any]]:
    """Return the tables of faults as dictionaries.

    Raises
    ------
    ParameterError
        When ``sections`` is not a sequence of tables.
    """
    is_sequence = isinstance(sections, Sequence) and not isinstance(sections, str)
    if not is_sequence or not all(isinstance(each, Mapping) for each in sections):
        raise ParameterError(
            "faults must be a sequence of tables ([[faults]] in a bench file)",
            name="faults",
            valid="a sequence of tables",
        )
    return [dict(each) for each in sections]


def with_faults(cases: Sequence[Case], sections: Sequence[Mapping[str, Any]]) -> tuple[Case, ...]:
    """Return the runs of an experiment with the faults that the sections describe.

    Raises
    ------
    InputError
        When a section is not valid for one of the models, when a fault begins after the end of
        every run, when two faults contradict each other, or when the experiment has no run.
    """
    if not cases:
        raise ParameterError(
            "this experiment has no run in which a fault could occur. Leave faults out",
            name="faults",
        )
    read = [injections(sections, case.model, case.par) for case in cases]
    first, longest = min(0.0 - case.settle for case in cases), max(case.duration for case in cases)
    for k, fault in enumerate(read[0]):
        _require_within(f"faults[{k + 1}]: {fault.mode.name}", fault.course, first, longest)
    return tuple(injected(case, each) for case, each in zip(cases, read, strict=True))


def _require_within(fault: str, course: Course, first: float, last: float) -> None:
    """Reject a fault that is absent, or recurs too often, between the ends of the runs [s]."""
    if course.onset >= last:
        raise ParameterError(
            f"{fault} begins at {course.onset:g} s, but the run ends at {last:g} s. Set an earlier "
            "onset, or lengthen the run",
            name="onset",
            value=f"{course.onset:g} s",
            valid=f"< {last:g} s",
        )
    if course.gone <= first:
        raise ParameterError(
            f"{fault} ends at {course.gone:g} s, but the run starts at {first:g} s. Set a longer "
            "duration (lasts), or a later onset",
            name="lasts",
            value=f"{course.lasts:g} s",
        )
    if course.returns(first, last) > MOST:
        raise ParameterError(
            f"{fault} recurs every {course.every:g} s, more than {MOST} times before {last:g} s. "
            "Set a longer period (every), or make the fault permanent",
            name="every",
            value=f"{course.every:g} s",
        )


def taps_of(faults: Sequence[Injection]) -> tuple[tuple[Tap, ...], tuple[str, ...]]:
    """Return the taps that some faults need, and the tasks that miss ticks.

    Raises
    ------
    ParameterError
        When faults delay one drive by different numbers of ticks.
    """
    taps: dict[str, Tap] = {}
    for fault in faults:
        tap = fault.mode.tap(fault.value)
        if tap is not None:
            before = taps.get(tap.name, tap)
            if before.late and tap.late and before.late != tap.late:
                raise ParameterError(
                    f"in one run, faults {fault.mode.name} have different values, "
                    f"{before.late} and {tap.late} ticks. Set both to the same value",
                    name=fault.mode.name,
                    value=str(tap.late),
                    valid=str(before.late),
                )
            taps[tap.name] = tap._replace(late=max(before.late, tap.late))
    tasks = dict.fromkeys(fault.mode.task for fault in faults if fault.mode.task)
    return tuple(taps[name] for name in sorted(taps)), tuple(sorted(tasks))


def injected(
    case: Case,
    faults: Sequence[Injection],
    taps: tuple[Tap, ...] = (),
    tasks: tuple[str, ...] = (),
) -> Case:
    """Return a run with faults.

    Parameters
    ----------
    case
        Run without faults.
    faults
        Its faults; their times are on the recording's axis.
    taps, tasks
        Taps, and tasks that can miss ticks, in a model that several runs share (default: those
        that the faults need).

    Raises
    ------
    ParameterError
        When two faults contradict each other.
    """
    _require_apart(faults, case.par)
    if not (taps or tasks):
        taps, tasks = taps_of(faults)
    changes = tuple(_changes(faults, case))
    plain = {each.name: getattr(case, each.name) for each in fields(Case)}
    if not (taps or tasks):
        return FaultyCase(**plain, changes=changes)
    model = Tapped(case.model, taps, tasks)
    plain |= {"model": model, "memory": model.started(case.state, case.memory), "start": None}
    corrupted = _corrupted(faults, case, {tap.name: tap for tap in taps})
    return FaultyCase(**plain, changes=changes, corrupted=corrupted)


def _corrupted(
    faults: Sequence[Injection], case: Case, taps: Mapping[str, Tap]
) -> Callable[[Array], dict[str, Array]]:
    periods = {task.name: task.period for task in case.model.tasks(case.par)}

    def signals(t: Array) -> dict[str, Array]:
        rows: dict[str, Array] = {}
        for fault in faults:
            mode, size = fault.mode, fault.course.size(t)
            # Each fault has its own generator, so another fault does not change its noise.
            draws = np.random.default_rng((fault.seed, zlib.crc32(mode.name.encode())))
            since = t - fault.course.onset
            given: dict[str, Any] = {}
            tap = mode.tap(fault.value)
            if tap is not None:
                names = taps[tap.name].controls()
                each = corrupt(mode, fault.value, size, since, case.par, draws)
                given = {names[kind]: values for kind, values in each.items()}
            elif mode.task:
                period = periods[mode.task]
                given = {rests(mode.task): missed(mode, fault.value, size, since, period, draws)}
            for name, values in given.items():
                rows[name] = rows.get(name, 0.0) + values
        return rows

    return signals


def _changes(faults: Sequence[Injection], case: Case) -> Iterator[tuple[float, ParameterSet]]:
    """Yield each time at which parameters change, with the new parameters."""
    changing = [fault for fault in faults if fault.mode.changes is not None]
    instants = {t for fault in changing for t in fault.course.instants(-case.settle, case.duration)}
    times = sorted({max(t, -case.settle) for t in instants if t < case.duration})
    for t in times:
        yield t, _at(changing, t, case.par)


def _at(faults: Sequence[Injection], t: float, par: ParameterSet) -> ParameterSet:
    """Return the parameters at a time [s]; on a ramp, numbers are interpolated."""
    values: dict[str, Any] = {}
    for fault in faults:
        (size,) = fault.course.size(np.array([t]))
        (there,) = fault.course.is_there(np.array([t]))
        for name, full in _full(fault, par).items() if there else ():
            now = par.value(name)
            is_number = isinstance(now, (int, float)) and not isinstance(now, bool)
            values[name] = now + size * (full - now) if is_number else full
    try:
        return par.replace(values)
    except ParameterError as error:
        names = " and ".join(fault.mode.name for fault in faults)
        raise error.reworded(f"fault {names}: {error}") from None


def _full(fault: Injection, par: ParameterSet) -> Mapping[str, Any]:
    return {} if fault.mode.changes is None else fault.mode.changes(par, fault.value)


def _require_apart(faults: Sequence[Injection], par: ParameterSet) -> None:
    """Reject simultaneous faults of one signal, task or parameter."""
    for one, other in combinations(faults, 2):
        first, second = one.course, other.course
        if first.onset >= second.gone or second.onset >= first.gone:
            continue
        both = touched(one.mode, one.value, par) & touched(other.mode, other.value, par)
        if both:
            raise ParameterError(
                f"faults {one.mode.name} and {other.mode.name} contradict each other: both change "
                f"{min(both)} at the same time. One must end before the other begins",
                name=min(both),
            )


def touched(mode: Mode, value: float, par: ParameterSet) -> set[str]:
    """Return phrases for the objects that a fault changes; simultaneous faults must share none."""
    signal = set() if mode.channel is None else {f"the signal {mode.channel.name}"}
    task = {f"the task {mode.task}"} if mode.task else set()
    return signal | task | ({*mode.changes(par, value)} if mode.changes is not None else set())
