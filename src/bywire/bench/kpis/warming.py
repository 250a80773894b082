"""Key figures of warm motors: temperatures, derating, and output when warm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, integral, signal, total
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording.

    Parameters
    ----------
    output
        Output that the motors produce, for example a pressure.
    winding
        Prefix of the names of the winding temperatures; the hottest motor counts.
    derated
        The ECU's mode "derated", 0 or 1.
    """

    output: str
    winding: str = "T_winding"
    derated: str = "derated"


@dataclass(frozen=True, eq=False)
class Warming:
    """Samples of temperature, mode and output.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    output
        Output that the motors produce [``unit``], shape ``(n,)``.
    unit
        SI unit of the output.
    winding
        Temperature of the hottest winding [K], shape ``(n,)``, or None if no motor warms up.
    derated
        1 while motors are derated, else 0; shape ``(n,)``, or None if it is not recorded.
    """

    t: Array
    output: Array
    unit: str
    winding: Array | None = None
    derated: Array | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the placeholder ``level``, which is the output's unit."""
        return {"level": self.unit}

    @cached_property
    def defect(self) -> str:
        """Reason why no figure is defined."""
        signals = (self.output, self.winding, self.derated)
        return defect(self.t, *(s for s in signals if s is not None))

    @property
    def note(self) -> str:
        """Empty: the samples are raw."""
        return ""


def select(recording: xr.Dataset, setting: Setting) -> Warming:
    """Return the samples for the figures; a missing signal leaves its figures undefined."""
    t, _ = signal(recording, "time")
    output, unit = signal(recording, setting.output)
    names = [str(name) for name in recording if str(name).startswith(setting.winding)]
    windings = [signal(recording, name)[0] for name in names]
    hottest = np.max(np.stack(windings), axis=0) if windings else None
    known = setting.derated in recording
    derated = signal(recording, setting.derated)[0] if known else None
    return Warming(t, output, unit, hottest, derated)


@measure("K", needs=("winding",))
def peak_winding(data: Warming) -> float | Undefined:
    """Maximum winding temperature of any motor."""
    if data.winding is None:
        return Undefined("no winding temperature is recorded")
    return float(np.max(data.winding))


@measure("K", needs=("winding",))
def final_winding(data: Warming) -> float | Undefined:
    """Temperature of the hottest winding at the end."""
    if data.winding is None:
        return Undefined("no winding temperature is recorded")
    return float(data.winding[-1])


@measure("s", needs=("derated",))
def time_derated(data: Warming) -> float | Undefined:
    """Time during which the motor's current is limited because the motor is too hot.

    Trapezoidal integral of the mode's samples: a change is assumed halfway between two samples.
    """
    if data.derated is None:
        return Undefined("the mode 'derated' is not recorded")
    return integral(data.t.tolist(), data.derated.tolist())


@measure("s", needs=("derated",))
def derated_after(data: Warming) -> float | Undefined:
    """Time of the first sample at which the motor is derated."""
    if data.derated is None:
        return Undefined("the mode 'derated' is not recorded")
    on = data.derated > 0.5
    if not on.any():
        return Undefined("the motor is never derated", is_open=True)
    return float(data.t[np.argmax(on)])


@measure("level")
def final_output(data: Warming) -> float:
    """Mean of the output over the last tenth of the recording."""
    late = data.t >= data.t[-1] - 0.1 * (data.t[-1] - data.t[0])
    return total(data.output[late].tolist()) / np.count_nonzero(late)
