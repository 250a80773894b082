"""Static gain of a step: how far it moves what answers it, once that is at rest.

Levels are those of `bywire.bench.kpis.step_response` in an open loop: the mean before the step, and
that in the window of the steady state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis import step_response
from bywire.bench.kpis.in_c import UNSOUND, InC
from bywire.bench.kpis.kpi import Values, Why, measure
from bywire.bench.kpis.smoothing import treatment
from bywire.bench.kpis.step_response import StepResponse
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """What the step was, and how to look at its response.

    Parameters
    ----------
    signal
        Name of the response in the recording.
    t_step
        Instant of the step [s].
    drive
        Height of the step [``unit``]; it may differ between cases that are judged together.
    unit
        SI unit of what was stepped.
    window
        Beginning and end [s] of the steady state; None for the last 20 % after the step.
    smoothing
        Averaging time [s]; 0 for the raw signal.
    """

    BY_CASE: ClassVar[tuple[str, ...]] = ("drive",)

    signal: str
    t_step: float
    drive: Any
    unit: str
    window: tuple[float, float] | None = None
    smoothing: float = 0.0


def _packed(setting: Setting, cases: int) -> Array:
    """Return the setting as the C takes it: what the step was, then its height in each case."""
    window = setting.window or (0.0, 0.0)
    step = (setting.t_step, setting.smoothing, float(setting.window is not None), *window)
    return np.concatenate((step, np.broadcast_to(setting.drive, cases)))


def _units(level: str, setting: Setting) -> dict[str, str]:
    return {"gain": f"{level}/{setting.unit}"}


IN_C = InC(
    signals=("signal",),
    reasons=(
        "nothing is stepped",
        "the step height is zero",
        "the response does not move",
        "the response changes by less than its ripple: no step is seen",
        "the response still moves at the end",
    ),
    open=(2, 3, 4, 5),
    failures=(
        UNSOUND,
        "the step is outside the recording",
        "the steady state's window holds < 2 samples",
    ),
    packed=_packed,
    note=lambda setting: treatment(setting.smoothing),
    units=_units,
    room=7,
)


@dataclass(frozen=True, eq=False)
class Gain:
    """A response with the height of its step, and the unit of the gain by its placeholder."""

    response: StepResponse
    drive: Any
    units: Mapping[str, str]

    @property
    def defect(self) -> str:
        """Why no figure is defined."""
        return self.response.defect

    @property
    def note(self) -> str:
        """How the samples were treated."""
        return self.response.note


def select(recording: xr.Dataset, setting: Setting) -> Gain:
    """Return the response from the step on, with what was stepped.

    Raises
    ------
    UnknownNameError
        When the recording does not hold the signal.
    """
    step = step_response.Setting(
        setting.signal, setting.t_step, window=setting.window, smoothing=setting.smoothing
    )
    response = step_response.select(recording, step)
    return Gain(response, setting.drive, _units(response.unit, setting))


@measure("gain")
def static_gain(data: Gain) -> Values:
    """Change of the mean level per height of the step."""
    drive = np.asarray(data.drive, dtype=np.float64)
    with np.errstate(all="ignore"):  # where nothing is stepped
        gains = np.asarray((data.response.end - data.response.start) / drive)
    nothing = Why(drive == 0.0, lambda _: "nothing is stepped")
    return Values(gains, nothing, *data.response.blind)
