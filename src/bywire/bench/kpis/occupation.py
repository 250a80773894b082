"""Fraction of time that a brake spends in a mode: stuck, or at a limit of its controller."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, integral


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording.

    Parameters
    ----------
    stuck, sat_current, sat_duty
        1 while in the mode, else 0.
    t_stuck
        Time stuck since the start [s].
    """

    stuck: str = "stuck"
    t_stuck: str = "t_stuck"
    sat_current: str = "sat_current"
    sat_duty: str = "sat_duty"


@measure("1")
def share_stuck(t: Samples, t_stuck: Samples | None, stuck: Samples | None) -> float | Undefined:
    """Fraction of time during which the shaft is stuck.

    The engine integrates the time stuck, including brief sticking between two samples. Recordings
    without this time use the samples of the mode, as in `share_sat_current`.
    """
    if t_stuck is not None:
        return (t_stuck[-1] - t_stuck[0]) / (t[-1] - t[0])
    if stuck is None:
        return Undefined("the mode 'stuck' is not recorded")
    if not _is_mode(stuck):
        return Undefined("the mode 'stuck' has values other than 0 and 1")
    return integral(t, stuck) / (t[-1] - t[0])


@measure("1")
def share_sat_current(t: Samples, sat_current: Samples | None) -> float | Undefined:
    """Fraction of time during which the current demand is saturated.

    Trapezoidal mean of the mode's samples: a change is assumed halfway between two samples.
    """
    if sat_current is None:
        return Undefined("the mode 'saturated current' is not recorded")
    if not _is_mode(sat_current):
        return Undefined("the mode 'saturated current' has values other than 0 and 1")
    return integral(t, sat_current) / (t[-1] - t[0])


@measure("1")
def share_sat_duty(t: Samples, sat_duty: Samples | None) -> float | Undefined:
    """Fraction of time during which the duty cycle is saturated.

    Trapezoidal mean of the mode's samples: a change is assumed halfway between two samples.
    """
    if sat_duty is None:
        return Undefined("the mode 'saturated duty cycle' is not recorded")
    if not _is_mode(sat_duty):
        return Undefined("the mode 'saturated duty cycle' has values other than 0 and 1")
    return integral(t, sat_duty) / (t[-1] - t[0])


def _is_mode(y: Samples) -> bool:
    """Whether a signal is 0 or 1 at every sample."""
    other = 0
    for x in y:
        other += x != 0.0 and x != 1.0
    return other == 0
