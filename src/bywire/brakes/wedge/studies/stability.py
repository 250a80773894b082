"""Wedge brake stability versus friction coefficient and slope, with and without control."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from bywire.analysis.locus import Border, locus
from bywire.analysis.loop_figures import LoopFigures
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.loops import MOMENT_LOOP
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.plants import full, mechanical, rigid_rate
from bywire.brakes.wedge.studies.drive_train import Count, Slope, redesigned
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.typing import Array, Progress
from bywire.data.labeled import labeled
from bywire.synthesis.study import (
    Cut,
    Findings,
    Map,
    Mark,
    Study,
    require_ranges,
    variable,
)

if TYPE_CHECKING:
    import xarray as xr

_POINTS = 200  # frequencies of a disk margin
_LOWEST = 0.05  # Hz
_SPAN = 1.5  # factor on both sides of the neutral point for the search for a stability limit
_EXACT = 1e-9
_FREE = 1e-12  # fraction of the largest coupling below which a coupling is a rounding error


class Motion(NamedTuple):
    """Slow motion of the wedge with its motors, and of the wedge alone.

    Parameters
    ----------
    growth, frequency
        Maximum growth rate [1/s] with the motors at constant currents, and its frequency [Hz].
    rigid
        Growth rate from the closed form of a rigid, undamped brake heart [1/s], 0 below neutral.
    locked
        Maximum growth rate with locked motors [1/s].
    """

    growth: float
    frequency: float
    rigid: float
    locked: float


class Controlled(NamedTuple):
    """The closed moment loop.

    Parameters
    ----------
    disk
        Disk margin, NaN if unstable.
    unstable
        1 if unstable, else 0, and NaN without an operating point.
    """

    disk: float
    unstable: float


def brake(
    par: WedgeParameters, mu_B: float, tan_alpha: float, known: bool = False
) -> WedgeParameters:
    """Return the brake with another wedge and other pads. Its controllers use the new wedge slope.

    ``mu_B``, ``tan_alpha``: pad friction coefficient and wedge slope; ``known``: whether the moment
    controller also uses the true friction coefficient.
    """
    redesign = redesigned(par, tan_alpha, par.screw.lead)
    slope = redesign.control.moment.slope_hat
    if known:
        slope *= mu_B / par.wedge.mu_B
    return redesign.replace({"wedge.mu_B": mu_B, "control.moment.slope_hat": slope})


def motion(par: WedgeParameters, F_N: float) -> Motion:
    """Return the uncontrolled wedge's motion at a normal force [N], without friction.

    Raises
    ------
    InputError
        If there is no operating point.
    """
    whole = mechanical(full(par, F_N))
    # If the force exceeds the preload, one motor is free, and no state depends on its angle.
    acting = np.abs(whole.A).max(axis=0) > _FREE * np.abs(whole.A).max()
    bound = whole.reduced(
        [n for n, acts in zip(whole.states, acting, strict=True) if acts], held=True
    )
    # Choose the pole with the highest growth rate. Rounding makes the choice in a pair unique.
    slow = max(bound.poles(), key=lambda s: (round(s.real, 9), s.imag))
    locked = whole.reduced(("x", "v"), held=True).poles()
    return Motion(
        float(slow.real),
        float(abs(slow.imag)) / (2.0 * math.pi),
        rigid_rate(par).real,
        float(locked.real.max()),
    )


def neutral(par: WedgeParameters, F_N: float) -> float:
    r"""Return the friction coefficient at which the uncontrolled wedge becomes unstable.

    The closed form of the neutral point is :math:`\mu_B = \tan\alpha`.

    Parameters
    ----------
    par
        The brake, whose own friction coefficient does not matter.
    F_N
        Normal force [N].

    References
    ----------
    Roberts et al. (2003), section "Introduction".
    """
    from scipy.optimize import brentq

    tan = wedge.slope(par.wedge)

    def growth(mu_B: float) -> float:
        return motion(par.replace({"wedge.mu_B": mu_B}), F_N).growth

    return float(brentq(growth, tan / _SPAN, tan * _SPAN, xtol=_EXACT))


def controlled(par: WedgeParameters, moment: float) -> Controlled:
    """Return stability and disk margin of the closed moment loop at a moment [N m].

    All NaN if the brake has no operating point at this moment.
    """
    try:
        gain, closed = MOMENT_LOOP.gain_and_closed(par, moment)
    except InputError:
        return Controlled(math.nan, math.nan)
    if not closed.is_stable:
        return Controlled(math.nan, 1.0)
    figures = LoopFigures(gain, closed, _POINTS, lowest=_LOWEST)
    return Controlled(figures.disk_margin, 0.0)


def _moment_borders(
    par: WedgeParameters, moment: float, between: tuple[float, float], count: int
) -> tuple[Border, ...]:
    """Return the friction coefficients at which the closed moment loop changes stability.

    Parameters
    ----------
    par
        The brake, whose controller keeps its assumptions.
    moment
        Operating point [N m].
    between, count
        Search range of friction coefficients, and number of values in it.

    Raises
    ------
    InputError
        If an operating point does not exist.
    """
    values = [float(value) for value in np.geomspace(*between, count)]
    return locus(MOMENT_LOOP, par, moment, "wedge.mu_B", "1", values).borders


Coefficient = Annotated[float, Unit("1", 0.4), Field(gt=0, le=5, allow_inf_nan=False)]
Force = Annotated[float, Unit("N", 1e3), Field(gt=0, allow_inf_nan=False)]

_ASSUMPTIONS = (
    "The linear models are exact for the brake without dry friction. Friction also holds the "
    "brake, so the real brake is stable in a wider range.",
    "Without control, both motors have constant currents or are locked. The wedge is preloaded "
    "between the screws and supports the specified normal force. If the actuation force exceeds "
    "the preload, one screw loses contact with the wedge, and the other moves or holds it alone.",
    "With control, a sampled moment loop works around position and current loops, at the specified "
    "moment. The controllers use the wedge's slope.",
    "The end stops of the wedge allow the same pad travel as before.",
)
_HIGHEST = 5.0
"""maximum friction coefficient in the search for the stability limit of the moment loop"""
_SEARCHED = 40
_PLANES = {
    "growth_open": ("1/s", "growth rate, motors at constant currents"),
    "frequency_open": ("Hz", "frequency of this motion, motors at constant currents"),
    "growth_rigid": ("1/s", "growth rate from the closed form of a rigid brake heart"),
    "growth_locked": ("1/s", "growth rate, motors locked"),
    "disk_moment": ("1", "disk margin of the moment loop"),
    "unstable_moment": ("1", "whether the moment loop is unstable"),
}
_FAST = 5.0  # minimum growth rate [1/s] for the comparison with the closed form


class Options(ParameterSet):
    """The designs to compare, and their operating points."""

    mu_B_min: Coefficient
    """minimum pad friction coefficient"""
    mu_B_max: Coefficient
    """maximum pad friction coefficient"""
    coefficients: Count
    """number of friction coefficients"""
    tan_alpha_min: Slope
    """minimum wedge slope"""
    tan_alpha_max: Slope
    """maximum wedge slope"""
    slopes: Count
    """number of slopes"""
    force: Force
    """normal force on the wedge without control"""
    moment: SomeMoment
    """moment demand in the moment loop"""
    believed: Literal["known", "as-given"]
    """whether the moment controller uses the true mu_B or the parameter set's value"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        slopes = ("tan_alpha_min", "tan_alpha_max", "1")
        require_ranges(self, (("mu_B_min", "mu_B_max", "1"), slopes))
        return self


DEFAULTS = Options(
    mu_B_min=0.1,
    mu_B_max=0.8,
    coefficients=21,
    tan_alpha_min=0.2,
    tan_alpha_max=0.6,
    slopes=13,
    force=1e3,
    moment=200.0,
    believed="as-given",
)
"""around the catalog's wedge and the pads of Roberts et al. (2003)"""


def compute(par: WedgeParameters, options: Options, progress: Progress) -> Findings:
    """Return growth rates, stability limits and disk margins over the map.

    Raises
    ------
    InputError
        If the wedge without control has no operating point.
    """
    mu = np.linspace(options.mu_B_min, options.mu_B_max, options.coefficients)
    tan = np.linspace(options.tan_alpha_min, options.tan_alpha_max, options.slopes)
    rows, borders = [], []
    known = options.believed == "known"
    for k, slope in enumerate(map(float, tan)):
        cases = [brake(par, float(mu_B), slope, known) for mu_B in mu]
        rows.append(
            [
                (*motion(design, options.force), *controlled(design, options.moment))
                for design in cases
            ]
        )
        borders.append(neutral(cases[0], options.force))
        progress("stability", (k + 1) / tan.size)
    data = _dataset(mu, tan, np.array(rows), np.array(borders))
    given = Mark("given wedge", par.wedge.mu_B, wedge.slope(par.wedge))
    kpis = (*_uncontrolled(par, data, options), *_controlled(par, data, options))
    return Findings(data, kpis, _ASSUMPTIONS, _maps(data, given), (_cut(data, given),))


def _dataset(mu: Array, tan: Array, values: Array, borders: Array) -> xr.Dataset:
    beyond = mu[None, :] - borders[:, None]
    planes = {**dict(zip(_PLANES, np.moveaxis(values, 2, 0), strict=True)), "beyond_open": beyond}
    border = variable(borders, ("tan_alpha",), "1", "friction coefficient of the neutral point")
    axes = {
        "tan_alpha": (tan, "1", "wedge slope, tan(alpha)"),
        "mu_B": (mu, "1", "pad friction coefficient"),
    }
    labels = _PLANES | {"beyond_open": ("1", "friction coefficient beyond the neutral point")}
    data = labeled(axes, {name: (plane, *labels[name]) for name, plane in planes.items()})
    return data.assign(border_open=border)


def _maps(data: xr.Dataset, given: Mark) -> dict[str, Map]:
    low = max(float(data["mu_B"][0]), float(data["tan_alpha"][0]))
    high = min(float(data["mu_B"][-1]), float(data["tan_alpha"][-1]))
    closed = {"tan(alpha) = mu_B": ((low, high), (low, high))} if low < high else {}
    return {
        "uncontrolled": Map(
            "growth_open",
            "mu_B",
            "tan_alpha",
            "Maximum growth rate of the wedge without control, with the motors at constant "
            "currents. The dashed line is the closed form of the neutral point, and the hatched "
            "boundary is computed. Colors are interpolated between designs, although the rate "
            "jumps at the boundary.",
            (given,),
            {"unstable without control": ("beyond_open", 0.0)},
            closed,
        ),
        "moment-loop": Map(
            "disk_moment",
            "mu_B",
            "tan_alpha",
            "Disk margin of the closed moment loop. The dashed line is the wedge's neutral point.",
            (given,),
            {"unstable in the moment loop": ("unstable_moment", 0.5)},
            closed,
        ),
    }


def _cut(data: xr.Dataset, given: Mark) -> Cut:
    row = data.sel(tan_alpha=given.y, method="nearest")
    names = ("growth_open", "frequency_open", "growth_rigid", "growth_locked", "disk_moment")
    title = f"tan(alpha) = {float(row['tan_alpha']):.3g}, the slope nearest to the given wedge's"
    return Cut(title, row[list(names)], ("mu_B", *names))


def _uncontrolled(par: WedgeParameters, data: xr.Dataset, options: Options) -> tuple[Kpi, ...]:
    growth, rigid = data["growth_open"].values, data["growth_rigid"].values
    fast = rigid > _FAST
    apart = np.abs(data["border_open"].values - data["tan_alpha"].values)
    error = float(np.max(np.abs(growth[fast] / rigid[fast] - 1.0))) if fast.any() else math.nan
    return (
        Kpi(
            "neutral_mu_B",
            neutral(par, options.force),
            "1",
            "Friction coefficient above which the given wedge is unstable without control.",
        ),
        Kpi(
            "neutral_deviation",
            float(apart.max()),
            "1",
            "Maximum distance between the neutral point and its closed form tan(alpha).",
        ),
        Kpi("growth_max", float(growth.max()), "1/s", "Maximum growth rate without control."),
        Kpi(
            "rigid_error",
            100.0 * error,
            "%",
            f"Maximum deviation of rates above {_FAST:g} 1/s from the closed form.",
        ),
        Kpi(
            "locked_growth_max",
            float(data["growth_locked"].max()),
            "1/s",
            "Maximum growth rate with locked motors; negative if they hold the wedge.",
        ),
    )


def _controlled(par: WedgeParameters, data: xr.Dataset, options: Options) -> tuple[Kpi, ...]:
    disk, unstable = data["disk_moment"].values, data["unstable_moment"].values
    least, where = math.nan, "no design is stable"
    if np.isfinite(disk).any():
        i, j = np.unravel_index(int(np.nanargmin(disk)), disk.shape)
        least = float(disk[i, j])
        where = (
            f"at mu_B = {float(data['mu_B'][j]):.3g}, "
            f"tan(alpha) = {float(data['tan_alpha'][i]):.3g}"
        )
    between = (options.mu_B_min, _HIGHEST)
    border = [
        b.value for b in _moment_borders(par, options.moment, between, _SEARCHED) if not b.above
    ]
    note = "" if border else f"stable up to {_HIGHEST:g}"
    return (
        Kpi("moment_disk_min", least, "1", "Minimum disk margin of the moment loop.", where),
        Kpi(
            "moment_unstable",
            float(np.nansum(unstable)),
            "1",
            "Number of designs with an unstable moment loop.",
        ),
        Kpi(
            "moment_mu_B",
            border[0] if border else math.nan,
            "1",
            "Friction coefficient above which the moment loop is unstable with the given wedge and "
            "controller.",
            note,
        ),
    )


STUDY = Study(
    name="stability",
    assembly="wedge-brake",
    summary="stability versus friction coefficient and wedge slope, with and without control",
    options=Options,
    defaults=DEFAULTS,
    compute=compute,
)
