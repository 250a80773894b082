"""Many simulated experiments, each identified from a start that is off."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from bywire.core.brake import load_system, loaded_files
from bywire.core.errors import BywireError, FileError, ParameterError
from bywire.core.parameters import ParameterSet
from bywire.identification.method import Effort, Method
from bywire.identification.unknown import parameters_of, scattered

Progress = Callable[[str, float], None]

_TRIES = 20


@dataclass(frozen=True)
class Outcome:
    """What one simulated experiment gave.

    Parameters
    ----------
    seed
        Of its noise and of its start.
    values, deviations, low, high
        By label: estimate, its standard deviation, and the 95 % interval, SI.
    units
        SI unit by label.
    failed_checks
        Names of the method's checks that did not hold.
    kept
        Labels that the data did not tell.
    error
        Why nothing was identified; empty where something was.
    """

    seed: int
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    units: Mapping[str, str]
    failed_checks: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    error: str = ""


def displaced(par: ParameterSet, names: Sequence[str], spread: float, seed: int) -> ParameterSet:
    """Return parameters with some of them up to ``spread`` off, so that a search has to move.

    Raises
    ------
    ParameterError
        When no admissible set is found around this one.
    """
    unknowns = parameters_of(par, [n for n in names if n in par.leaves()])
    if not unknowns or spread == 0.0:
        return par
    for one in scattered(unknowns, _TRIES + 1, spread, seed)[1:]:
        try:
            return par.replace({u.name: float(v) for u, v in zip(unknowns, one, strict=True)})
        except ParameterError:
            continue
    raise ParameterError(f"no admissible parameters within {100 * spread:g} % of these: lower it")


def experiments(
    method: Method,
    par: Any,
    options: Any,
    seeds: Iterable[int],
    effort: Effort,
    *,
    processes: int | None = 1,
    store: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Outcome, ...]:
    """Simulate and identify one experiment per seed; the arguments are those of ``trust``."""
    chosen = replace(effort, threads=1, store=None, progress=None)
    wanted = list(dict.fromkeys(seeds))
    key = _key(method, par, options, chosen)
    done = {o.seed: o for o in _read(store, key) if o.seed in set(wanted)}
    missing = [seed for seed in wanted if seed not in done]
    one = partial(experiment, method, par, options, chosen)
    with closing(_made(one, missing, processes or os.cpu_count() or 1)) as made:
        for outcome in made:
            done[outcome.seed] = outcome
            _append(store, key, outcome)
            if progress is not None:
                progress("experiments", len(done) / len(wanted))
    return tuple(done[seed] for seed in wanted)


def experiment(method: Method, par: Any, options: Any, effort: Effort, seed: int) -> Outcome:
    """Simulate one experiment and identify it from a start that is off."""
    try:
        data = method.synthetic(par, options, seed)
        start = par if par is None else displaced(par, method.unknowns, effort.spread, seed)
        found = method.identify(data, start, options, replace(effort, seed=seed))
    except BywireError as error:
        return Outcome(seed, {}, {}, {}, {}, {}, error=str(error))
    values: dict[str, float] = {}
    deviations, low, high = dict(values), dict(values), dict(values)
    units: dict[str, str] = {}
    for estimate in found.estimates.values():
        values |= dict(zip(estimate.names, estimate.values.tolist(), strict=True))
        deviations |= dict(zip(estimate.names, estimate.deviations.tolist(), strict=True))
        units |= {u.label: u.unit for u in estimate.unknowns}
        ends = estimate.intervals()
        low |= dict(zip(estimate.names, ends[:, 0].tolist(), strict=True))
        high |= dict(zip(estimate.names, ends[:, 1].tolist(), strict=True))
    kept = tuple(k.unknown.label for e in found.estimates.values() for k in e.kept)
    checks = tuple(check.name for check in found.checks if not check.holds)
    return Outcome(seed, values, deviations, low, high, units, checks, kept)


def _made(
    one: Callable[[int], Outcome], seeds: Sequence[int], processes: int
) -> Generator[Outcome, None, None]:
    if processes < 2 or len(seeds) < 2:
        yield from map(one, seeds)
        return
    context = multiprocessing.get_context("spawn")  # forks of a process with threads may hang
    count = min(processes, len(seeds))
    with context.Pool(count, _prepare_worker, (loaded_files(),)) as pool:
        yield from pool.imap_unordered(one, seeds)


def _prepare_worker(systems: tuple[str, ...]) -> None:
    """Leave interrupts to the parent, and know the brakes that it loaded by path."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for path in systems:
        load_system(path)


def _key(method: Method, par: Any, options: Any, effort: Effort) -> str:
    own = "" if par is None else par.model_dump_json()
    name = f"{method.name}{method.key}"
    text = f"{name} {own} {options.model_dump_json()} {effort.starts} {effort.spread}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _read(store: Path | None, key: str) -> Iterator[Outcome]:
    """Yield the finished experiments; a last line that was cut off is left out."""
    if store is None or not store.exists():
        return
    try:
        lines = store.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{store} cannot be read: {error}; delete it to start anew") from None
    for line in lines:
        try:
            row = json.loads(line)
            if row.pop("key") == key:
                row |= {name: tuple(row[name]) for name in ("failed_checks", "kept")}
                yield Outcome(**row)
        except (ValueError, KeyError, TypeError, AttributeError):
            continue


def _append(store: Path | None, key: str, outcome: Outcome) -> None:
    if store is None:
        return
    try:
        with store.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": key, **asdict(outcome)}) + "\n")
    except OSError as error:
        raise FileError(f"cannot write {store}: {error.strerror}") from None
