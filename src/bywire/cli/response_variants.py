"""What ``bywire frequency-response`` measures: one case, or those of a range, at their points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import xarray as xr

from bywire.analysis.response.broadband import Broadband, broadband_response
from bywire.analysis.response.dataset import Sweep
from bywire.analysis.response.frequency_response import frequency_response, require_stable
from bywire.analysis.response.large_signal import Variant, variants_over
from bywire.api.loop_case import LoopCase, over_range
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.units import shown
from bywire.report.wording import amount


def sustained(chosen: LoopCase, changes: Mapping[str, str]) -> tuple[Variant, str]:
    """Return the loop such that it can be shaken for as long as it takes, and what that changed.

    What the user set stays.
    """
    loop = chosen.loop
    par = chosen.par.replace({k: v for k, v in loop.sustained.items() if k not in changes})
    before, after = chosen.par.flat(), par.flat()
    units = {name: leaf.unit.symbol for name, leaf in leaf_fields(type(chosen.par)).items()}
    texts = [
        f"{name} = {shown(value, units[name]) if name in units else value}"
        for name, value in after.items()
        if value != before[name]
    ]
    note = f"set for sines that last: {', '.join(texts)}; --set keeps another value"
    return Variant(loop, par, chosen.value), note if texts else ""


def cases_over(
    base: Variant, chosen: LoopCase, range_: str
) -> tuple[list[Variant], tuple[str, str]]:
    """Return the cases of a range, or the one without, and name and unit of what varies.

    Raises
    ------
    ParameterError
        When the linear loop is unstable in one of them.
    """
    if not range_:
        require_stable(base.loop.closed(base.par, base.value))
        return [base], ("", "1")
    name, unit, values = over_range(range_, chosen)
    variants = variants_over(base, name, values)
    for one in variants:
        try:
            require_stable(base.loop.closed(one.par, one.value))
        except ParameterError as error:
            raise ParameterError(f"{name} = {amount(one.label, unit)}: {error}") from None
    return variants, (name, unit)


def measured(
    variants: Sequence[Variant],
    sweep: Sweep,
    excitation: str,
    progress: Callable[[str, float], None],
) -> xr.Dataset:
    """Return the response of all cases, each around its own operating point."""
    points = [one.point.run() for one in variants]
    if excitation == "sine":
        found = frequency_response(points[0], sweep, progress, points=points)
        return found.assign_attrs(excitation=excitation)
    kind = Broadband(cast(Any, excitation))
    return broadband_response(points[0], sweep, kind, progress, points=points)
