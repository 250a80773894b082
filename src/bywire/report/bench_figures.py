"""Figures of experiments: the kinds that experiments list, drawn from their results."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.kpis import sine_sweep
from bywire.bench.running import Result
from bywire.bench.stated import stated_for
from bywire.core.errors import ParameterError
from bywire.core.registry import Kind, instances
from bywire.report.energy_balance import ledger_bars
from bywire.report.friction_figures import hysteresis_loop, stribeck_curve
from bywire.report.response_figures import Response, bode
from bywire.report.step_response import StepFacts, step_limits, step_response, tracking
from bywire.report.time_traces import overlaid_traces, time_traces

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Shown:
    """A figure with a file name and a caption."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class FigureKind:
    """A kind of figure for experiments.

    Parameters
    ----------
    name
        Name in experiments.
    draw
        ``draw(result)``: the figures of a result.
    """

    name: str
    draw: Callable[[Result], list[Shown]]


def bench_figures(result: Result) -> list[Shown]:
    """Return the figures of a result, in the order of its experiment."""
    shown: list[Shown] = []
    for kind in result.bench.definition.figures:
        shown += FIGURES.find(kind).draw(result)
    return shown


def _step_response(result: Result) -> list[Shown]:
    definition = result.bench.definition
    if definition.step is None:
        return []
    setting = definition.step(result.bench.chosen_options)
    recording = result.recorded["run"]
    kpis = {kpi.name: kpi.value for kpi in result.kpis}
    judged = step_limits(definition, result.bench.chosen_options)
    facts = None
    if judged is not None:
        facts = StepFacts(
            rise_time=kpis.get("rise_time"),
            settling_time=kpis.get("settling_time"),
            overshoot=kpis["overshoot"] / 100.0 if "overshoot" in kpis else None,
        )
    demand = setting.set_point or None
    figure = step_response(
        recording,
        setting.signal,
        demand,
        limits=None if judged is None else judged[1],
        facts=facts,
        smoothing=setting.smoothing,
        stated=stated_for(result.bench),
    )
    return [Shown("step-response", figure, "Step response with its 2 % band.")]


def _time_traces(result: Result) -> list[Shown]:
    return [
        Shown(
            f"time-traces-{label}" if len(result.recorded) > 1 else "time-traces",
            time_traces(recording, stated=stated_for(result.bench)),
            f"Time traces{f', {label}' if len(result.recorded) > 1 else ''}. Shaded: stuck. "
            "Lightly shaded: repeatedly stuck, with the stuck fraction of the shaded time.",
        )
        for label, recording in result.recorded.items()
        if "time" in recording.dims
    ]


def _overlaid_traces(result: Result) -> list[Shown]:
    """Return a figure for all recordings whose labels differ only in the first part."""
    groups: dict[str, dict[str, xr.Dataset]] = {}
    for label, recording in result.recorded.items():
        line, _, group = label.partition("-")
        groups.setdefault(group, {})[line] = recording
    return [
        Shown(
            f"overlaid-traces-{group}" if group else "overlaid-traces",
            overlaid_traces(recordings, result.bench.definition.compared),
            f"{', '.join(recordings)}{f': {group}' if group else ''}.",
        )
        for group, recordings in groups.items()
    ]


def _energy_balance(result: Result) -> list[Shown]:
    shown = []
    for label, recording in result.recorded.items():
        suffix = f"-{label}" if len(result.recorded) > 1 else ""
        after = recording.sel(time=slice(-1e-9, None))
        caption = "Energy balance of the actuator from time zero: sources and sinks."
        books = {"energy-balance": (actuator_ledger(after), caption)}
        for book, further in further_ledgers(after).items():
            books[f"energy-{book.replace(' ', '-')}"] = (further, f"The same {book}.")
        for name, (postings, caption) in books.items():
            with contextlib.suppress(ParameterError):  # a brake at rest converts no energy
                shown.append(Shown(name + suffix, ledger_bars(postings), caption))
    return shown


def _hysteresis_loop(result: Result) -> list[Shown]:
    definition = result.bench.definition
    if definition.loop is None:
        return []
    setting = definition.loop(result.bench.chosen_options)
    figure = hysteresis_loop(
        result.recorded, setting.response, setting.drive, setting.demand, setting.smoothing
    )
    caption = "Response versus drive, up and back down."
    return [Shown("hysteresis-loop", figure, caption)]


def _stribeck_curve(result: Result) -> list[Shown]:
    figure = stribeck_curve(result.recorded["curve"])
    return [Shown("stribeck-curve", figure, "Friction versus speed.")]


def _tracking(result: Result) -> list[Shown]:
    definition = result.bench.definition
    if definition.followed is None:
        return []
    setting = definition.followed(result.bench.chosen_options)
    figure = tracking(result.recorded["run"], setting.signal, setting.set_point)
    return [Shown("tracking", figure, "Signal and the set point that it follows.")]


def _sine_sweep(result: Result) -> list[Shown]:
    definition = result.bench.definition
    if definition.sweep is None:
        return []
    setting = definition.sweep(result.bench.chosen_options)
    sweep = sine_sweep.select(result.recorded["run"], setting)
    if not sweep.frequencies.size:  # interrupted within the first sine
        return []
    response = Response(
        f"{setting.drive} to {setting.response}", sweep.frequencies, sweep.values, measured=True
    )
    caption = "Gain and phase of the output at the sine frequencies."
    return [Shown("sine-sweep", bode([response]), caption)]


GENERAL = (
    FigureKind("step-response", _step_response),
    FigureKind("time-traces", _time_traces),
    FigureKind("overlaid-traces", _overlaid_traces),
    FigureKind("energy-balance", _energy_balance),
    FigureKind("hysteresis-loop", _hysteresis_loop),
    FigureKind("stribeck-curve", _stribeck_curve),
    FigureKind("tracking", _tracking),
    FigureKind("sine-sweep", _sine_sweep),
)

FIGURES = Kind("figure", ("figures",), instances(FigureKind), "bywire.report.bench_figures")
"""all kinds of figures for experiments"""
