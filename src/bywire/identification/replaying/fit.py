"""How well a replay fits: figures over stretches of a record, judged against tolerances."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict
from bywire.bench.step_error import with_step_errors
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.data.lag import estimate_lag
from bywire.identification.replaying.segments import Segment
from bywire.identification.replaying.tolerances import judge_fit, require_known

_LARGEST_LAG = 0.25  # of a stretch
_FIRST_LAG = 8.0  # samples
_NO_LAG = 1e-3  # samples: what rounding makes of none


@dataclass(frozen=True)
class SegmentFit:
    """How well one signal is met over one stretch.

    Parameters
    ----------
    segment, signal
        Where, and what.
    kpis
        Its figures.
    verdicts
        Tolerances that apply to it.
    """

    segment: Segment
    signal: str
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]


def fit_figures(pair: xr.Dataset, segment: Segment) -> tuple[Kpi, ...]:
    """Return the figures of one signal over one stretch.

    Parameters
    ----------
    pair
        ``measured`` and ``modeled`` over ``time`` [s]; where one is NaN nothing is compared.
    segment
        The stretch.

    Returns
    -------
    tuple of Kpi
        ``rmse``, ``nrmse`` (over the range of the whole record), ``vaf`` (variance accounted
        for), ``max_error``, ``bias``, ``lag`` (model behind measurement, by correlation).

    Raises
    ------
    ParameterError
        When the stretch goes beyond the record, or holds fewer than two samples.
    """
    _require_within(pair["time"].values, segment)
    part = pair.sel(time=slice(segment.start - 1e-9, segment.stop + 1e-9))
    y, m = part["measured"].values, part["modeled"].values
    there = np.isfinite(y) & np.isfinite(m)
    if there.sum() < 2:
        raise ParameterError(
            f"segment {segment.name!r}, {segment.start:g} to {segment.stop:g} s, holds "
            f"{int(there.sum())} samples: two at least are needed"
        )
    y, m = y[there], m[there]
    error = m - y
    whole = pair["measured"].values[np.isfinite(pair["measured"].values)]
    span, unit = float(np.ptp(whole)), str(pair["measured"].attrs.get("units", "1"))
    rmse = float(np.sqrt(np.mean(error**2)))
    variance = float(np.var(y))
    lag, lag_note = _lag(part, there)
    still = "the measured signal does not move"
    return (
        Kpi("rmse", rmse, unit, "Root mean square of modeled less measured."),
        Kpi(
            "nrmse",
            100.0 * rmse / span if span else math.nan,
            "%",
            "That over the measured range of the whole record.",
            "" if span else still,
        ),
        Kpi(
            "vaf",
            100.0 * (1.0 - float(np.var(error)) / variance) if variance else math.nan,
            "%",
            "Variance accounted for: 1 less that of the error over that of the measurement.",
            "" if variance else still,
        ),
        Kpi("max_error", float(np.abs(error).max()), unit, "Largest magnitude of the error."),
        Kpi("bias", float(error.mean()), unit, "Mean of modeled less measured."),
        Kpi("lag", lag, "s", "By how much the model is later, by correlation.", lag_note),
    )


def _require_within(time: Array, segment: Segment) -> None:
    """Refuse a stretch of which a part was not measured; by a sample's interval it may."""
    first, last = float(time[0]), float(time[-1])
    spare = 1.001 * float(np.median(np.diff(time)))
    if segment.start < first - spare or segment.stop > last + spare:
        raise ParameterError(
            f"segment {segment.name!r}, {segment.start:g} to {segment.stop:g} s, goes beyond the "
            f"record, which holds {first:.6g} to {last:.6g} s: correct its start or stop"
        )


def _lag(part: xr.Dataset, there: NDArray[np.bool_]) -> tuple[float, str]:
    """Return the lag nearest to zero at which both go together best, and a note.

    A periodic signal looks alike a period later: the range of lags grows until it holds a peak.
    """
    if not there.all():
        return math.nan, "the measured signal has gaps"
    t = part["time"].values
    step, most = float(t[1] - t[0]), _LARGEST_LAG * float(t[-1] - t[0])
    reach = max(_FIRST_LAG * step, 0.02 * most)
    while reach < most:
        try:
            peak = estimate_lag(part, "measured", "modeled", largest=reach, interval=step)
        except ParameterError as error:
            return math.nan, str(error)
        if not peak.at_limit and peak.correlation > 0.0:
            value = peak.value if abs(peak.value) > _NO_LAG * step else 0.0
            return value, f"correlation {peak.correlation:.4f}"
        reach *= 2.0
    return math.nan, "no lag stands out"


def judged(
    outputs: Mapping[str, xr.Dataset],
    segments: Sequence[Segment],
    others: Mapping[float, Mapping[str, xr.Dataset]] = MappingProxyType({}),
) -> tuple[SegmentFit, ...]:
    """Return the figures of all signals over all stretches, with the verdicts.

    With ``others``, the same in other steps by their length over the run's, figures have their
    error from the step, and a tolerance that is closer than that is undecided.

    A tolerance named ``nrmse`` holds for every signal, ``p_mc.nrmse`` for one; its limits are
    read by `bywire.identification.replaying.tolerances.judge_fit`.

    Raises
    ------
    ParameterError, UnitError
        When a limit cannot be read, or a stretch goes beyond the record.
    UnknownNameError
        When a tolerance names no figure or signal.
    """
    fits = []
    for segment in segments:
        figures = {name: fit_figures(pair, segment) for name, pair in outputs.items()}
        require_known(segment.tolerances, figures)
        for name, kpis in figures.items():
            if others:
                in_others = {f: fit_figures(made[name], segment) for f, made in others.items()}
                kpis = with_step_errors(kpis, in_others, {})
            verdicts = judge_fit(segment.tolerances, name, kpis)
            fits.append(SegmentFit(segment, name, kpis, verdicts))
    return tuple(fits)


def undefined(fits: Sequence[SegmentFit]) -> tuple[str, ...]:
    """Return why figures are not defined, a sentence for each reason."""
    where: dict[tuple[str, str, str], list[str]] = {}
    for fit in fits:
        for kpi in fit.kpis:
            if math.isnan(kpi.value):
                where.setdefault((kpi.name, fit.signal, kpi.note), []).append(fit.segment.name)
    return tuple(
        f"{figure} of {signal} is not defined in {', '.join(segments)}: {reason}"
        for (figure, signal, reason), segments in where.items()
    )
