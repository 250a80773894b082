"""How warm motors get, and how long they are derated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, integral, signal, total
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording.

    Parameters
    ----------
    output
        What the motors bring about.
    winding
        Beginning of the names of the windings' temperatures: of several motors the hottest counts.
    derated
        The mode of the ECU.
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
        What the motors bring about, in SI, shape ``(n,)``.
    unit
        Its unit.
    winding
        Temperature of the hottest winding [K], shape ``(n,)``, or None where no motor warms up.
    derated
        1 while motors are derated, else 0; shape ``(n,)``, or None where it is not recorded.
    """

    t: Array
    output: Array
    unit: str
    winding: Array | None = None
    derated: Array | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """The output's unit stands for a level."""
        return {"level": self.unit}

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        given = (self.output, self.winding, self.derated)
        return defect(self.t, *(s for s in given if s is not None))

    @property
    def note(self) -> str:
        """Nothing is treated."""
        return ""


def select(recording: xr.Dataset, setting: Setting) -> Warming:
    """Return what the figures need; a signal that is not recorded leaves its figure undefined."""
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
    """Highest temperature of a motor's winding."""
    if data.winding is None:
        return Undefined("no temperature of a winding is recorded")
    return float(np.max(data.winding))


@measure("K", needs=("winding",))
def final_winding(data: Warming) -> float | Undefined:
    """Temperature of the hottest winding at the end."""
    if data.winding is None:
        return Undefined("no temperature of a winding is recorded")
    return float(data.winding[-1])


@measure("s", needs=("derated",))
def time_derated(data: Warming) -> float | Undefined:
    """Time in which the motor's current is limited for its temperature.

    Trapezoidal integral of the mode's samples: a change counts as halfway between two samples.
    """
    if data.derated is None:
        return Undefined("the mode 'derated' is not recorded")
    return integral(data.t.tolist(), data.derated.tolist())


@measure("s", needs=("derated",))
def derated_after(data: Warming) -> float | Undefined:
    """Time of the first sample in which the motor is derated."""
    if data.derated is None:
        return Undefined("the mode 'derated' is not recorded")
    on = data.derated > 0.5
    if not on.any():
        return Undefined("the motor is never derated", is_open=True)
    return float(data.t[np.argmax(on)])


@measure("level")
def final_output(data: Warming) -> float:
    """Mean of the output in the last tenth of the time."""
    late = data.t >= data.t[-1] - 0.1 * (data.t[-1] - data.t[0])
    return total(data.output[late].tolist()) / np.count_nonzero(late)
