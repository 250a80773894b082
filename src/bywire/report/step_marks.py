"""What a step is judged by: tolerance band, overshoot limit, rise and settling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bywire.bench.experiment import Experiment
from bywire.bench.requirements import Verdict
from bywire.core.errors import ParameterError
from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel
from bywire.report.line_role import Role

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class StepLimits:
    """A step of the set point and its limits; levels in SI.

    Parameters
    ----------
    start
        Time of the step [s].
    before, after
        Set point before and after it.
    band
        Half width of the tolerance band, as a share of the step.
    overshoot
        Admissible overshoot as a share of the step; ``None`` for no limit.
    """

    start: float
    before: float
    after: float
    band: float = 0.02
    overshoot: float | None = None

    def __post_init__(self) -> None:
        if self.before == self.after:
            raise ParameterError(
                f"StepLimits: before and after are both {self.after:g}: that is no step"
            )

    def level(self, share: float) -> float:
        """Return the level at a share of the step: 0 before it, 1 after it."""
        return self.before + share * (self.after - self.before)


@dataclass(frozen=True)
class StepFacts:
    """What was computed about a step response; ``None`` for what was not.

    Parameters
    ----------
    rise_time
        From ``rise_from`` to ``rise_to`` [s].
    settling_time
        From the step until the response stays in the band [s].
    overshoot
        As a share of the step.
    rise_from, rise_to
        Shares of the step between which the rise is measured.
    """

    rise_time: float | None = None
    settling_time: float | None = None
    overshoot: float | None = None
    rise_from: float = 0.1
    rise_to: float = 0.9


def step_limits(
    definition: Experiment, options: Any, verdicts: Sequence[Verdict] = ()
) -> tuple[str, StepLimits] | None:
    """Return the signal of a step and what it is judged by; None where nothing is known of one.

    Parameters
    ----------
    definition, options
        The experiment and its options.
    verdicts
        Requirements, of which one on the overshoot is drawn.
    """
    setting = None if definition.step is None else definition.step(options)
    if setting is None or setting.start is None or setting.end is None:
        return None
    if setting.start == setting.end:
        return None
    limits = [v.required.bound for v in verdicts if v.kpi == "overshoot"]
    overshoot = limits[0] / 100.0 if limits else None
    return setting.signal, StepLimits(
        setting.t_step, setting.start, setting.end, overshoot=overshoot
    )


def draw_limits(axes: Axes, limits: StepLimits, shown: Channel) -> None:
    """Draw tolerance band and overshoot limit, from the step to the end of the recording.

    ``axes``: axes in the display unit of ``shown``; ``limits``: the step; ``shown``: the channel
    that is judged.
    """
    scale, _ = style.time_scale(shown.time)
    span = [scale * limits.start, scale * float(shown.time[-1])]
    low, high = (
        convert(limits.level(1.0 + side * limits.band), shown.symbol, shown.unit)
        for side in (-1.0, 1.0)
    )
    axes.fill_between(
        span,
        min(low, high),
        max(low, high),
        color=style.GREEN,
        alpha=0.25,
        linewidth=0,
        zorder=1.5,
        label=f"±{100 * limits.band:g} % band",
    )
    if limits.overshoot is not None:
        level = convert(limits.level(1.0 + limits.overshoot), shown.symbol, shown.unit)
        look = style.STROKES[Role.LIMIT]
        axes.plot(
            span,
            [level, level],
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label=f"overshoot limit {100 * limits.overshoot:g} %",
        )
