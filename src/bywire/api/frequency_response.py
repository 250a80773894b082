"""A closed loop's response by amplitude: friction, limits and sampling included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import xarray as xr

from bywire.analysis.response import frequency_response as by_sines
from bywire.analysis.response.broadband import Broadband, broadband_response
from bywire.analysis.response.frequency_response import require_stable, with_step_errors
from bywire.analysis.response.large_signal import (
    Variant,
    variants_over,
    widths,
    with_widths,
)
from bywire.analysis.response.sweep import Sweep
from bywire.api.frequency_response_answer import FrequencyResponse
from bywire.api.loop_case import LoopCase
from bywire.bench.running import Progress
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.units import shown
from bywire.report.wording import amount


def measured_response(
    case: LoopCase,
    overrides: Mapping[str, Any],
    frequencies: list[float],
    amplitudes: list[float],
    over: tuple[str, str, list[float]],
    excitation: str,
    progress: Progress,
    *,
    estimate_error: bool,
) -> FrequencyResponse:
    """Return the response of a loop, with its error from the step where that is asked for.

    Parameters
    ----------
    case, overrides
        The loop at its operating point, and what the user changed.
    frequencies, amplitudes
        Of the input [Hz, SI].
    over
        Name, unit and values of the range for bandwidths; an empty name without one.
    excitation, progress, estimate_error
        As of `bywire.frequency_response`.

    Raises
    ------
    ParameterError
        When the linear loop is unstable.
    """
    base, note = _sustained(case, overrides)
    variants = _variants(base, over)
    point = variants[0].point
    flags = [n for n in point.model.Output._fields if n == "stuck" or n.startswith("sat_")]
    sweep = Sweep(
        case.loop.inputs,
        case.loop.output,
        frequencies,
        amplitudes,
        flags=flags,
        whole=case.loop.whole(point.par),
        saturations=case.loop.saturations,
    )
    response = _measured(variants, sweep, excitation, progress)
    response = with_widths(response, widths(variants, response))
    if estimate_error:
        response = _with_step_errors(response, variants, sweep, excitation, progress)
    linear = variants[0].linear(response["frequency"].values)
    return FrequencyResponse(
        case,
        response,
        linear,
        tuple(variants),
        over[:2],
        case.input_unit,
        note,
        sweep.tolerance,
    )


def _sustained(case: LoopCase, changes: Mapping[str, Any]) -> tuple[Variant, str]:
    """Return the loop such that it can be shaken for as long as it takes, and what that changed.

    What the user set stays.
    """
    loop = case.loop
    par = case.par.replace({k: v for k, v in loop.sustained.items() if k not in changes})
    before, after = case.par.flat(), par.flat()
    units = {name: leaf.unit.symbol for name, leaf in leaf_fields(type(case.par)).items()}
    texts = [
        f"{name} = {shown(value, units[name]) if name in units else value}"
        for name, value in after.items()
        if value != before[name]
    ]
    note = f"set for sines that last: {', '.join(texts)}; {option('overrides')} keeps another "
    note += "value"
    return Variant(loop, par, case.value), note if texts else ""


def _variants(base: Variant, over: tuple[str, str, list[float]]) -> list[Variant]:
    """Return the cases of a range, or the one without.

    Raises
    ------
    ParameterError
        When the linear loop is unstable in one of them.
    """
    name, unit, values = over
    if not name:
        require_stable(base.loop.closed(base.par, base.value))
        return [base]
    variants = variants_over(base, name, values)
    for variant in variants:
        try:
            require_stable(base.loop.closed(variant.par, variant.value))
        except ParameterError as error:
            raise ParameterError(f"{name} = {amount(variant.label, unit)}: {error}") from None
    return variants


def _with_step_errors(
    response: xr.Dataset,
    variants: Sequence[Variant],
    sweep: Sweep,
    excitation: str,
    progress: Progress,
) -> xr.Dataset:
    """Return a response with its errors from the step, or with why these are not known."""
    share = OTHER_STEPS[0]
    try:
        finer = _measured(variants, sweep, excitation, progress, share)
    except NO_ESTIMATE as error:
        return response.assign_attrs(unestimated=str(error))
    finer = with_widths(finer, widths(variants, finer))
    return with_step_errors(response, finer, of_difference(share))


def _measured(
    variants: Sequence[Variant],
    sweep: Sweep,
    excitation: str,
    progress: Progress,
    share: float = 1.0,
) -> xr.Dataset:
    """Return the response of all cases, each around its own operating point.

    ``share``: of the loop's step, in which they run.
    """
    runs = [variant.point.run() for variant in variants]
    points = [replace(run, step=share * run.step) for run in runs]
    if excitation == "sine":
        response = by_sines.frequency_response(points[0], sweep, progress, points=points)
        return response.assign_attrs(excitation=excitation)
    kind = Broadband(cast(Any, excitation))
    return broadband_response(points[0], sweep, kind, progress, points=points)
