"""How long a brake is in a mode: stuck, or at a limit of its controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis.in_c import InC
from bywire.bench.kpis.kpi import Undefined, Values, Why, measure
from bywire.bench.kpis.samples import defect, integral, signal
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording."""

    BY_CASE: ClassVar[tuple[str, ...]] = ()

    stuck: str = "stuck"
    t_stuck: str = "t_stuck"
    sat_current: str = "sat_current"
    sat_duty: str = "sat_duty"


IN_C = InC(
    signals=("stuck", "t_stuck", "sat_current", "sat_duty"),
    reasons=("the mode is not recorded", "the mode holds other values than 0 and 1"),
)


@dataclass(frozen=True, eq=False)
class Occupation:
    """Samples of the modes.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    stuck, sat_current, sat_duty
        1 while in the mode, else 0; shape ``(..., n)``, or None where it is not recorded.
    t_stuck
        Time stuck since the start [s], shape ``(..., n)``, or None.
    """

    t: Array
    stuck: Array | None = None
    t_stuck: Array | None = None
    sat_current: Array | None = None
    sat_duty: Array | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """No placeholder is used."""
        return {}

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        signals = (self.stuck, self.t_stuck, self.sat_current, self.sat_duty)
        return defect(self.t, *(s for s in signals if s is not None))

    @property
    def note(self) -> str:
        """Nothing is treated."""
        return ""


def select(recording: xr.Dataset, setting: Setting) -> Occupation:
    """Return what the figures need; a signal that is not recorded leaves its figure undefined."""
    t, _ = signal(recording, "time")
    names = (setting.stuck, setting.t_stuck, setting.sat_current, setting.sat_duty)
    signals = (signal(recording, name)[0] if name in recording else None for name in names)
    return Occupation(t, *signals)


@measure("1", needs=("t_stuck", "stuck"))
def share_stuck(data: Occupation) -> Array | Values | Undefined:
    """Share of the time during which the shaft is stuck.

    From the time stuck that the engine integrates, where it is recorded: short sticking between
    two samples counts. Else from the samples of the mode, as `share_sat_current`.
    """
    if data.t_stuck is not None:
        return np.asarray((data.t_stuck[..., -1] - data.t_stuck[..., 0]) / (data.t[-1] - data.t[0]))
    return _share(data.t, data.stuck, "stuck")


@measure("1", needs=("sat_current",))
def share_sat_current(data: Occupation) -> Array | Values | Undefined:
    """Share of the time during which the current demand is saturated.

    Trapezoidal mean of the mode's samples: a change counts as halfway between two samples.
    """
    return _share(data.t, data.sat_current, "saturated current")


@measure("1", needs=("sat_duty",))
def share_sat_duty(data: Occupation) -> Array | Values | Undefined:
    """Share of the time during which the duty cycle is saturated.

    Trapezoidal mean of the mode's samples: a change counts as halfway between two samples.
    """
    return _share(data.t, data.sat_duty, "saturated duty cycle")


def _share(t: Array, mode: Array | None, label: str) -> Values | Undefined:
    if mode is None:
        return Undefined(f"the mode '{label}' is not recorded")
    other = ~np.all((mode == 0.0) | (mode == 1.0), axis=-1)
    share = integral(t, mode) / (t[-1] - t[0])
    text = f"the mode '{label}' holds other values than 0 and 1"
    return Values(share, Why(other, lambda _: text))
