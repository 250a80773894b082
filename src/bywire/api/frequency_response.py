"""A closed loop's response by amplitude: friction, limits and sampling included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
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
from bywire.api.loop_case import LoopCase, loop_case, over_range, spread
from bywire.bench.running import Progress
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.blas import on_one_thread
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.parameters import leaf_fields
from bywire.core.typing import silent
from bywire.core.units import shown
from bywire.report.answer import use_case
from bywire.report.wording import amount

_POINTS = 20
_EXCITATIONS = ("sine", "multisine", "chirp")


@use_case
@on_one_thread()
def frequency_response(
    loop: str,
    parameters: str = "",
    at: str = "",
    overrides: Mapping[str, Any] = MappingProxyType({}),
    *,
    frequencies: str = "",
    amplitudes: str = "",
    excitation: str = "sine",
    over: str = "",
    progress: Progress | None = None,
    estimate_error: bool = True,
    side: str = "",
) -> FrequencyResponse:
    """Measure a closed loop's response by amplitude on the nonlinear model.

    Parameters
    ----------
    loop, parameters, at, overrides
        As of `bywire.margins`.
    frequencies
        ``"1 Hz:150 Hz:20"``, or a list with commas; twenty over the loop's band by default.
    amplitudes
        With their unit and commas; the loop's own by default.
    excitation
        ``"sine"`` (one frequency at a time), ``"multisine"``, or ``"chirp"``.
    over
        Range for bandwidths, ``"NAME=LOW:HIGH:COUNT"``.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether the response is measured in half steps too: gain, phase and bandwidths then say
        how large their error from the step is (``NAME_step_error`` in ``data``).
    side
        Of the linear models, as of `bywire.margins`.

    Returns
    -------
    FrequencyResponse
        Gain and phase [degree] by frequency [Hz] and amplitude [SI], with bandwidths in Hz.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, sets of another brake, unstable loops.
    """
    if excitation not in _EXCITATIONS:
        raise unknown_name("excitation", excitation, _EXCITATIONS)
    case = loop_case(loop, parameters, at, overrides, side)
    unit = case.input_unit
    wanted = case.frequencies(frequencies, _POINTS)
    sizes = spread(amplitudes, unit, "amplitudes") if amplitudes else list(case.loop.amplitudes)
    base, note = _sustained(case, overrides)
    variants, varied = _variants(base, case, over)
    point = variants[0].point
    flags = [n for n in point.model.Output._fields if n == "stuck" or n.startswith("sat_")]
    sweep = Sweep(
        case.loop.inputs,
        case.loop.output,
        wanted,
        sizes,
        flags=flags,
        whole=case.loop.whole(point.par),
        saturations=case.loop.saturations,
    )
    response = _measured(variants, sweep, excitation, progress or silent)
    response = with_widths(response, widths(variants, response))
    if estimate_error:
        response = _with_step_errors(response, variants, sweep, excitation, progress or silent)
    linear = variants[0].linear(response["frequency"].values)
    return FrequencyResponse(
        case, response, linear, tuple(variants), varied, unit, note, sweep.tolerance
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
    note = f"set for sines that last: {', '.join(texts)}; --set keeps another value"
    return Variant(loop, par, case.value), note if texts else ""


def _variants(base: Variant, case: LoopCase, range_: str) -> tuple[list[Variant], tuple[str, str]]:
    """Return the cases of a range, or the one without, and name and unit of what varies.

    Raises
    ------
    ParameterError
        When the linear loop is unstable in one of them.
    """
    if not range_:
        require_stable(base.loop.closed(base.par, base.value))
        return [base], ("", "1")
    name, unit, values = over_range(range_, case)
    variants = variants_over(base, name, values)
    for variant in variants:
        try:
            require_stable(base.loop.closed(variant.par, variant.value))
        except ParameterError as error:
            raise ParameterError(f"{name} = {amount(variant.label, unit)}: {error}") from None
    return variants, (name, unit)


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
