"""Digests of a bench's computation, which identify saved studies."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.bench_file import PATHS
from bywire.bench.changes import split_options
from bywire.bench.kpis.families import FAMILIES, Family
from bywire.bench.stimulus import STIMULI
from bywire.core.brake import brakes
from bywire.core.definitions import definitions_digest
from bywire.core.errors import InputError
from bywire.core.version import __version__
from bywire.simulation.engine import prepare

_ROOMS = (
    "bywire.bench.experiments",
    "bywire.bench.faults.modes",
    "bywire.bench.generic_experiment",
    "bywire.bench.kpis",
    "bywire.bench.stimuli",
    "bywire.bench.stimulus",
    "bywire.control",
    "bywire.plant",
    "bywire.vehicle",
)


def computation(
    bench: Bench, choices: Iterable[Mapping[str, Any]] = (), beside: Iterable[Any] = ()
) -> dict[str, Any]:
    """Digests of a bench's equations, runs and key figures.

    File names, comments, docstrings and the location of a definition do not matter.

    Parameters
    ----------
    bench
        Tested bench.
    choices
        Parameters and options by dotted name that cases change.
    beside
        Additional functions that judge its runs, and objects that contain such functions.
    """
    return {
        "equations": sorted({each for b in (bench, *_chosen(bench, choices)) for each in _of(b)}),
        "figures": functions_digest((*_functions(bench), *beside)),
    }


def bench_identity(bench: Bench, choices: Iterable[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """Everything that affects a bench's recordings and key figures.

    ``choices``: see `computation`.
    """
    identity: dict[str, Any] = {
        "version": __version__,
        "computed": computation(bench, choices),
        "experiment": bench.experiment,
        "system": bench.system,
        "parameters": bench.par.flat(),
        "options": bench.chosen_options.flat(),
        "stimuli": {
            name: [each.kind, each.parameters.model_dump(mode="json")]
            for name, each in bench.chosen_stimuli.items()
        },
        "step": None if math.isnan(bench.step) else bench.step,
        "record": bench.record,
        "noise": bench.seed,
    }
    if bench.error is not None:
        identity["error"] = float(bench.error)
    if bench.faults:
        identity["faults"] = bench.faults
    if bench.engine.startswith("sil"):  # all other engines compute the same bits
        identity["engine"] = bench.engine
    return identity | files_identity(bench)


def files_identity(bench: Bench) -> dict[str, Any]:
    """Digest of every file that the options name. Empty without such files."""
    files = {
        name: hashlib.sha256(Path(str(value)).read_bytes()).hexdigest()
        for name, value in bench.chosen_options.flat().items()
        if name in PATHS and value and Path(str(value)).is_file()
    }
    return {"files": files} if files else {}


def functions_digest(roots: Iterable[Any], *rooms: str, with_equations: bool = False) -> str:
    """Digest of functions and of all definitions that they reach in brakes and their elements.

    Parameters
    ----------
    roots
        Functions, and objects that contain functions.
    rooms
        Additional packages whose source text counts.
    with_equations
        Whether the equations of models also count.
    """
    reached = (*_ROOMS, *rooms, *(brake.module for brake in brakes().values()))
    return definitions_digest(roots, reached, _family, with_equations)


def _chosen(bench: Bench, choices: Iterable[Mapping[str, Any]]) -> Iterator[Bench]:
    for each in choices:
        try:
            yield bench.varied(*split_options(each))
        except InputError:  # a choice that needs another one, whose case raises the error
            continue


def _of(bench: Bench) -> Iterator[str]:
    """Yield the digest of each run's equations, with the periods of its controllers."""
    for case in bench.cases():
        tasks = [f"{task.name} {task.period:.12g} s" for task in case.model.tasks(case.par)]
        yield ", ".join([prepare(case.model, case.par).digest, *tasks])


def _functions(bench: Bench) -> Iterator[Any]:
    chosen = bench.definition
    yield from (chosen.cases, chosen.judge, chosen.finish, chosen.static, chosen.beside)
    for stimulus in bench.chosen_stimuli.values():
        yield STIMULI.find(stimulus.kind).function
    for fault in bench.injections:
        yield fault.mode.changes


def _family(text: str) -> Iterator[Any]:
    """Yield the functions of a family of key figures, if a text is a family's name."""
    family = FAMILIES.guess(text) if text.isidentifier() and text.islower() else None
    if isinstance(family, Family):
        yield family.setting_class
        yield from family.measures.values()
        yield family.select if family.loops is None else family.loops.shared
