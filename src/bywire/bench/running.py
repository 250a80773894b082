"""Benches run: recordings, key figures and verdicts."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case, as_run
from bywire.bench.extent import check_extent
from bywire.bench.recording import record
from bywire.bench.requirements import judge
from bywire.bench.result import Result
from bywire.bench.stimuli.registry import Stimulus
from bywire.core.interrupts import interrupts_deferred
from bywire.core.signals import signals_of
from bywire.simulation.engine import prepare
from bywire.simulation.run import simulate

Progress = Callable[[str, float], None]


def run(bench: Bench, progress: Progress | None = None, engine: str = "auto") -> Result:
    """Make all runs of a bench, and judge them.

    Parameters
    ----------
    bench
        What is tested; `bywire.load` makes one of a bench file.
    progress
        Called with the run's label and its finished share, 0 to 1.
    engine
        ``auto``, ``compiled`` or ``virtual-machine``.

    Raises
    ------
    InputError
        When the experiment cannot be set up.
    RunError
        When a run fails.
    """
    definition, options = bench.definition, bench.chosen_options
    recordings: dict[str, xr.Dataset] = {}
    if definition.static is not None:
        given = {"parameters": bench.par.model_dump_json(), **_bench_notes(bench)}
        static = definition.static(bench.par, options)
        recordings |= {label: each.assign_attrs(given) for label, each in static.items()}
    try:
        for number, case in enumerate(bench.cases()):
            recording = _recorded(bench, case, number, progress, engine)
            is_complete = recording.attrs["status"] != "interrupted"
            if is_complete or recording.sizes["time"] > 1:
                finish = definition.finish or _as_it_is
                recordings[case.label] = finish(recording, options)
            if not is_complete:
                raise KeyboardInterrupt
    except KeyboardInterrupt:  # also from outside the engine, which keeps what it has
        return Result(bench, recordings, (), (), "interrupted")
    kpis = definition.judge(recordings, options)
    verdicts = judge(bench.requirements, kpis)
    status = "passed" if all(v.met for v in verdicts) else "failed"
    status = status if verdicts else "done"
    return Result(bench, recordings, kpis, verdicts, status)


def _as_it_is(recording: xr.Dataset, _: Any) -> xr.Dataset:
    return recording


def _recorded(
    bench: Bench, case: Case, number: int, progress: Progress | None, engine: str
) -> xr.Dataset:
    whole = as_run(case, bench.step, seed=(bench.seed, number))
    check_extent(case, whole)
    report = None if progress is None else (lambda share: progress(case.label, share))
    with interrupts_deferred():
        prepare(whole.model, whole.par).engine(engine)
    trajectory = simulate(whole, engine=engine, progress=report)
    notes = {**_bench_notes(bench), "case": case.label, "seed": bench.seed}
    recording = record(whole, trajectory, case.settle, case.keep, notes)
    return recording if bench.definition.beside is None else _with_inputs(recording, case)


def _bench_notes(bench: Bench) -> dict[str, str]:
    """Return the attributes of a recording that say which bench it is of."""
    return {
        "model": bench.system,
        "experiment": bench.experiment,
        "parameter_set": bench.parameters,
        "options": bench.chosen_options.model_dump_json(),
        "stimulus": json.dumps(_described(bench.chosen_stimuli)),
    }


def _with_inputs(recording: xr.Dataset, case: Case) -> xr.Dataset:
    """Return a recording with what drove the model, where the model does not record that."""
    time = recording["time"].values
    signals = signals_of(case.model.Stimulus)
    given = {name: y for name, y in case.stimulus(time).items() if name not in recording}
    return recording.assign({
        name: ("time", y, {"units": signals[name].unit, "long_name": signals[name].label})
        for name, y in given.items()
    })  # fmt: skip


def _described(stimuli: Mapping[str, Stimulus]) -> dict[str, Any]:
    """Return stimuli as ``[stimulus]`` sections in SI; empty where none is given."""
    found = {
        name: {"kind": each.kind, **each.parameters.model_dump(mode="json")}
        for name, each in stimuli.items()
    }
    return {**found.pop("", {}), **found}
