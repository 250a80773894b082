"""Figure of a wedge's actuation force and brake factor versus pad friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.running import Result
from bywire.brakes.wedge.case import tag
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.bench_figures import FigureKind, Shown
from bywire.report.panels import Role

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FARTHEST = 60.0
"""maximum brake factor on the y axis, because the factor is unbounded at the neutral point"""


@dataclass(frozen=True)
class WedgeForces:
    """Ratio of actuation force to normal force at several friction coefficients.

    ``mu_B``: pad friction coefficients, ascending; ``free``: force ratio at rest without friction
    in the brake; ``rising``, ``falling``: force ratio with friction, while the moment rises and
    falls slowly.
    """

    mu_B: Sequence[float]
    free: Sequence[float]
    rising: Sequence[float]
    falling: Sequence[float]

    def __post_init__(self) -> None:
        columns = (self.mu_B, self.free, self.rising, self.falling)
        sizes = {len(column) for column in columns}
        if sizes == {0} or len(sizes) != 1:
            raise ParameterError(
                "WedgeForces: mu_B, free, rising and falling have "
                f"{', '.join(str(len(column)) for column in columns)} entries. They need the same "
                "number of entries, at least one",
                name="WedgeForces",
                value=", ".join(str(len(column)) for column in columns),
            )


def brake_factor(forces: WedgeForces, tan_alpha: float) -> Figure:
    """Draw force ratio and brake factor C* versus the friction coefficient.

    ``forces``: computed forces; ``tan_alpha``: tangent of the wedge angle, where the closed form
    changes sign.
    """
    mu = np.asarray(forces.mu_B, dtype=np.float64)
    figure, (upper, lower) = style.new_figure(5.0, (1.0, 1.0))
    line = np.linspace(mu[0], mu[-1], 601)
    look = style.STROKES[Role.SET_POINT]
    for axes, over in ((upper, False), (lower, True)):
        axes.plot(
            line,
            _shown(line, tan_alpha - line, over),
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label="closed form, without friction",
        )
        for label, color, marker, ratio in (
            ("simulated, without friction", style.BLUE, "o", forces.free),
            ("with friction, moment rises", style.VERMILLION, "^", forces.rising),
            ("with friction, moment falls", style.GREEN, "v", forces.falling),
        ):
            values = _shown(mu, np.asarray(ratio, dtype=np.float64), over)
            axes.plot(mu, values, marker, color=color, markersize=4.5, zorder=4, label=label)
        axes.axvline(
            tan_alpha,
            color=style.GRAY,
            linestyle=":",
            linewidth=1.0,
            zorder=1.5,
            label="tan(alpha)",
        )
        axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    lower.set_ylim(-1.05 * FARTHEST, 1.05 * FARTHEST)
    upper.set_ylabel(style.axis_label("actuation / normal force", "1", "\n"))
    lower.set_ylabel(style.axis_label("brake factor C*", "1", "\n"))
    lower.set_xlabel(style.axis_label("pad friction coefficient", "1"))
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _shown(mu: Array, ratio: Array, over: bool) -> Array:
    """Return the force ratio, or the brake factor where it is within the y axis."""
    if not over:
        return ratio
    with np.errstate(divide="ignore"):
        factor = 2.0 * mu / ratio
    return np.where(np.abs(factor) <= FARTHEST, factor, np.nan)


def _of_static_test(result: Result) -> list[Shown]:
    """Return the figure of the wedge brake's static test, from its key figures."""
    kpis = {kpi.name: kpi.value for kpi in result.kpis}
    tried = sorted(result.bench.chosen_options.flat()["mu_B"])
    r_B = result.bench.par.flat()["caliper.r_B"]
    moment = float(result.bench.chosen_options.flat()["M_hold"])
    free, rising, falling = (
        [kpis[f"{name}_{tag(mu_B)}"] * 2.0 * mu_B * r_B / moment for mu_B in tried]
        for name in ("F_M", "F_M_rising", "F_M_falling")
    )
    figure = brake_factor(WedgeForces(tried, free, rising, falling), kpis["neutral_mu_closed"])
    caption = "Ratio of actuation force to normal force, and brake factor, versus pad friction."
    return [Shown("brake-factor", figure, caption)]


FIGURE = FigureKind("brake-factor", _of_static_test)
