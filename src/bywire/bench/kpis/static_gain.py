"""Static gain of a step: change of the response at rest, divided by the step height.

Levels are those of `bywire.bench.kpis.step_response` in an open loop: the mean before the step, and
the mean in the window of the steady state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, moving_average, treatment
from bywire.bench.kpis.step_response import Response, level_before, response_from, why_unseen


@dataclass(frozen=True)
class Setting:
    """The step, and the treatment of its response.

    Parameters
    ----------
    signal
        Name of the response in the recording.
    t_step
        Time of the step [s].
    drive
        Height of the step [``unit``].
    unit
        SI unit of the step.
    window
        Start and end [s] of the steady state; None for the last 20 % after the step.
    smoothing
        Averaging time [s]; 0 for the raw signal.
    """

    signal: str
    t_step: float
    drive: float
    unit: str
    window: tuple[float, float] | None = None
    smoothing: float = 0.0

    @property
    def note(self) -> str:
        """Note on the treatment of the samples."""
        return treatment(self.smoothing)

    def units(self, level: str) -> Mapping[str, str]:
        """Unit of the gain, from the unit of the response."""
        return {"gain": f"{level}/{self.unit}"}


def response(t: Samples, signal: Samples, setting: Setting) -> Response | Undefined:
    """Response from the step on, in an open loop."""
    y = moving_average(t, signal, setting.smoothing) if setting.smoothing > 0.0 else signal
    start = level_before(t, y, setting.t_step, setting.smoothing)
    return response_from(t, y, setting.t_step, start, None, setting.window)


@measure("gain")
def static_gain(response: Response, setting: Setting) -> float | Undefined:
    """Change of the mean level, divided by the step height."""
    if setting.drive == 0.0:
        return Undefined("the step height is zero")
    unseen = why_unseen(response)
    if unseen is not None:
        return unseen
    return (response.end - response.start) / setting.drive
