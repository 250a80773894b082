r"""What a design keeps besides its requirements: distance from instability, and a set point met.

A loop that is asked for a bandwidth alone is best at the border of stability; one that is asked
for a phase margin alone needs no integral action. The disk margin :math:`\alpha` guarantees (P.
Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control Systems Magazine
40(5), 2020, section on disk-based gain and phase margins)

.. math:: g_m \ge \frac{2 + \alpha}{2 - \alpha}, \quad
    g_l \le \frac{2 - \alpha}{2 + \alpha}, \quad \varphi_m \ge 2 \arctan\frac{\alpha}{2}

and by it the user's own requirements of margins tell how much less is wanted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from bywire.bench.requirements import Limit
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.requirement import read

DISK = 0.5
"""disk margin that is kept: gain by a factor of 1.67, phase by 28 degree"""
ERROR = 5.0
"""steady-state error that is kept [%]"""
_WORSE = 1.5  # what may become of the start's figures where these are kept
_TRACKS = 50.0  # error above which an output does not follow the set point by design, %


def linear_floors(requirements: Sequence[Limit], error: float) -> tuple[Limit, ...]:
    """Return what every model keeps: a disk margin, and an error in the end.

    Parameters
    ----------
    requirements
        The user's; a margin below what `DISK` guarantees lowers that, and a requirement of the
        same figure takes its place.
    error
        The start's largest steady-state error [%]; NaN for an unstable start. An error larger
        than `ERROR` may grow by half; one of a loop that does not track is not kept.
    """
    texts = []
    named = {wanted.figure for wanted in requirements}
    if "disk_margin" not in named:
        disk = min([DISK, *(_implied(wanted) for wanted in requirements)])
        texts.append(f"disk_margin >= {disk:.3g}")
    if "steady_state_error" not in named and not error > _TRACKS:
        limit = ERROR if math.isnan(error) else max(ERROR, _WORSE * error)
        texts.append(f"steady_state_error <= {limit:.3g} %")
    return read(texts) if texts else ()


def bench_floors(
    requirements: Sequence[Limit],
    floors: Sequence[Limit],
    trials: Iterable[BenchFigures],
) -> tuple[Limit, ...]:
    """Return what retuned gains keep of the linear design's: floors, and how its step settled.

    Parameters
    ----------
    requirements
        The user's.
    floors
        See `linear_floors`.
    trials
        The linear design on the bench, in every trial.
    """
    steps = [figures.step for figures in trials if figures.step]
    kept = list(floors)
    named = {wanted.figure for wanted in requirements}
    errors = [step["steady_state_error"] for step in steps]
    if errors and "steady_state_error" not in named:
        kept = [floor for floor in kept if floor.figure != "steady_state_error"]
        if all(error <= _TRACKS for error in errors):  # NaN is not
            kept += read([f"steady_state_error <= {max(ERROR, _WORSE * max(errors)):.3g} %"])
    times = [step["settling_time"] for step in steps]
    if times and "settling_time" not in named and all(0.0 < time < math.inf for time in times):
        kept += read([f"settling_time <= {_WORSE * max(times):.3g} s"])
    return tuple(kept)


def _implied(wanted: Limit) -> float:
    """Return the disk margin that guarantees a required margin; infinity for other figures.

    Half of it where the margin must not be larger.
    """
    if wanted.figure == "phase_margin":
        disk = 2.0 * math.tan(math.radians(0.5 * wanted.bound))
    elif wanted.figure == "gain_margin":
        disk = 2.0 * (wanted.bound - 1.0) / (wanted.bound + 1.0)
    elif wanted.figure == "lower_gain_margin":
        disk = 2.0 * (1.0 - wanted.bound) / (1.0 + wanted.bound)
    elif wanted.figure == "sensitivity_peak":  # |S - T| = |2 S - 1| <= 2 max|S| + 1
        return (1.0 if wanted.is_upper else 0.5) * 2.0 / (2.0 * wanted.bound + 1.0)
    else:
        return math.inf
    is_least = wanted.is_upper == (wanted.figure == "lower_gain_margin")
    return max(disk * (1.0 if is_least else 0.5), 1e-3)
