"""Many drive trains of the wedge brake beside each other, as a dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import xarray as xr

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sizing.design import Answer, Demand, Efficiency, answer, redesigned
from bywire.core.interrupts import thread_pool
from bywire.core.typing import Array
from bywire.data.labeled import Labeled, labeled
from bywire.synthesis.study import variable

LATE = 1.02
"""share of the demanded time up to which a design answers equally fast"""
HELD = 0.95
"""share of the demand that counts as held"""
LEFT = 0.05
"""share of the demand below which the brake counts as released"""
_NEVER = 10.0  # what stands for the lateness of a moment that is never reached

_PER_CASE = {
    "t_90": ("s", "time to 90 % of the demand"),
    "filtered": ("W", "largest power, filtered"),
    "instantaneous": ("W", "largest power"),
    "release": ("W", "largest power of the release, filtered"),
    "current": ("A", "largest current demand"),
    "speed": ("rad/s", "largest motor speed"),
    "copper": ("J", "copper loss"),
    "friction": ("J", "friction of bearings and screws"),
    "held": ("N*m", "mean moment at the end of the stop"),
    "left": ("N*m", "moment left at the end"),
    "stop": ("N", "force on the end stops"),
}


def mapped(
    par: WedgeParameters,
    demand: Demand,
    slopes: Array,
    leads: Array,
    progress: Callable[[float], None] = lambda share: None,
    efficiency: Efficiency = "friction-angle",
) -> xr.Dataset:
    """Return what all designs on a grid do; on all cores, stopped by an interrupt.

    ``slopes``, ``leads``: slopes of the wedge, shape (n,), and leads of the screws [m], shape (m,);
    ``progress``: called with the finished share, 0 to 1; ``efficiency``: see `redesigned`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``tan_alpha``, ``lead`` and ``mu_B``. Per case the fields of `Answer`; per
        design ``closing_speed``, ``lateness`` (slowest time over the demanded one), ``infeasible``
        (0 or 1), and ``worst_filtered`` and ``worst_instantaneous``, NaN where infeasible, with
        ``mu_B_filtered`` and ``mu_B_instantaneous``, where each occurs.
    """
    designs = [(float(a), float(b)) for a in slopes for b in leads]
    answers: list[Answer] = []
    with thread_pool() as pool:
        every = pool.map(
            lambda design: answer(redesigned(par, design[0], design[1], efficiency), demand),
            designs,
        )
        for k, judged in enumerate(every):
            answers.append(judged)
            progress((k + 1) / len(designs))
    axes = {
        "tan_alpha": (slopes, "1", "slope of the wedge"),
        "lead": (leads, "m", "lead of the screws"),
        "mu_B": (np.asarray(demand.mu_B), "1", "friction coefficient of the pads"),
    }
    return _dataset(answers, demand, axes)


def _dataset(answers: Sequence[Answer], demand: Demand, axes: Mapping[str, Labeled]) -> xr.Dataset:
    plane, shape = ("tan_alpha", "lead"), [len(each[0]) for each in axes.values()]
    cases = {
        name: np.array([getattr(each, name) for each in answers]).reshape(shape)
        for name in _PER_CASE
    }
    data = labeled(axes, {name: (cases[name], *_PER_CASE[name]) for name in _PER_CASE})
    slowest = cases["t_90"].max(axis=2)  # NaN where one case never gets there
    lateness = np.where(np.isnan(slowest), _NEVER, slowest / demand.t_90)
    in_time = (lateness <= LATE) if demand.enforced else (lateness < _NEVER)
    holds = cases["held"].min(axis=2) >= HELD * demand.moment
    released = cases["left"].max(axis=2) <= LEFT * demand.moment
    feasible = in_time & holds & released & (cases["stop"].max(axis=2) == 0.0)
    speeds = np.array([each.closing_speed for each in answers]).reshape(shape[:2])
    data["closing_speed"] = variable(speeds, plane, "m/s", "closing speed of the pads")
    data["lateness"] = variable(lateness, plane, "1", "slowest time over the demanded time")
    data["infeasible"] = variable(1.0 - feasible, plane, "1", "late, not held, or at a stop")
    for name in ("filtered", "instantaneous"):
        worst = np.where(feasible, cases[name].max(axis=2), np.nan)
        mu_B = np.asarray(demand.mu_B)[cases[name].argmax(axis=2)]
        label = f"largest {name} power, worst mu_B"
        data[f"worst_{name}"] = variable(worst, plane, "W", label)
        data[f"mu_B_{name}"] = variable(mu_B, plane, "1", "worst friction coefficient")
    data.attrs["unsettled_substeps"] = sum(each.unsettled for each in answers)
    return data
