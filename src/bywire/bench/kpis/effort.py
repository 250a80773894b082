"""What an experiment costs: currents, powers and energy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis.in_c import InC
from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, integral, signal
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording."""

    BY_CASE: ClassVar[tuple[str, ...]] = ()

    current: str = "i"
    power: str = "P_el"
    energy: str = "E_source"


IN_C = InC(
    signals=("current", "power", "energy"),
    reasons=(
        "no current is recorded",
        "no electrical power is recorded",
        "neither energy nor electrical power is recorded",
    ),
)


@dataclass(frozen=True, eq=False)
class Effort:
    """Samples of current, electrical power and energy.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    current
        Motor current [A], shape ``(..., n)``, or None where it is not recorded.
    power
        Electrical power drawn [W], shape ``(..., n)``, or None.
    energy
        Energy drawn since the start [J], shape ``(..., n)``, or None: then the power is integrated
        between the samples, which misses what happens between them.
    """

    t: Array
    current: Array | None = None
    power: Array | None = None
    energy: Array | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """No placeholder is used."""
        return {}

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        given = (s for s in (self.current, self.power, self.energy) if s is not None)
        return defect(self.t, *given)

    @property
    def note(self) -> str:
        """Nothing is treated."""
        return ""


def select(recording: xr.Dataset, setting: Setting) -> Effort:
    """Return what the figures need; a signal that is not recorded leaves its figures undefined."""
    t, _ = signal(recording, "time")
    names = (setting.current, setting.power, setting.energy)
    signals = (signal(recording, name)[0] if name in recording else None for name in names)
    return Effort(t, *signals)


@measure("A", needs=("current",))
def peak_current(data: Effort) -> Array | Undefined:
    """Largest magnitude of the motor current.

    Over the recorded samples; dither and ripple count.
    """
    if data.current is None:
        return Undefined("no current is recorded")
    return np.asarray(np.max(np.abs(data.current), axis=-1))


@measure("A", needs=("current",))
def mean_current(data: Effort) -> Array | Undefined:
    """Mean over time of the magnitude of the motor current.

    Trapezoidal rule over the samples. Dither that changes the current's sign counts in full.
    """
    if data.current is None:
        return Undefined("no current is recorded")
    return np.asarray(integral(data.t, np.abs(data.current)) / (data.t[-1] - data.t[0]))


@measure("W", needs=("power",))
def peak_power(data: Effort) -> Array | Undefined:
    """Largest electrical power drawn from battery or source.

    Signed: power fed back is negative. Over the recorded samples; dither and ripple count.
    """
    if data.power is None:
        return Undefined("no electrical power is recorded")
    return np.asarray(np.max(data.power, axis=-1))


@measure("W", needs=("energy", "power"))
def mean_power(data: Effort) -> Array | Undefined:
    """Energy drawn over the duration of the recording."""
    drawn = _drawn(data)
    return drawn if isinstance(drawn, Undefined) else drawn / (data.t[-1] - data.t[0])


@measure("J", needs=("energy", "power"))
def energy(data: Effort) -> Array | Undefined:
    """Energy drawn from battery or source during the recording.

    The recorded energy at the end less that at the beginning; where no energy is recorded, the
    integral of the recorded power by the trapezoidal rule.
    """
    return _drawn(data)


def _drawn(data: Effort) -> Array | Undefined:
    if data.energy is not None:
        return np.asarray(data.energy[..., -1] - data.energy[..., 0])
    if data.power is not None:
        return integral(data.t, data.power)
    return Undefined("neither energy nor electrical power is recorded")
