"""Dither against stick-slip: a periodic current that overcomes the assumed breakaway torque."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    BreakawayFactor,
    Frequency,
    Gain,
    Torque,
    TorqueConstant,
    TorquePerPressure,
)
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Shape of the dither."""

    waveform: Literal["off", "sine", "square", "triangle"]
    """waveform; the sine wave of the paper has the lowest harmonic distortion"""
    f_dit: Frequency
    """frequency, above the pressure-loop bandwidth and below the current-loop bandwidth"""
    gain: Gain
    """amplitude relative to the assumed breakaway current"""


class Believed(ParameterSet):
    """Friction and motor assumed by the ECU, possibly with errors."""

    K_e: TorqueConstant
    """torque constant"""
    T_pr: Torque
    """friction torque at zero pressure"""
    f_cfr_p: TorquePerPressure
    """increase of the Coulomb torque with pressure in the apply direction"""
    k_brk_p: BreakawayFactor
    """ratio of breakaway torque to Coulomb torque in the apply direction"""


_ROUNDING = 1e-9  # fraction of the period, much larger than rounding and much smaller than a sample


class State(NamedTuple):
    """Phase as a fraction of the period, 0 <= phase < 1 except for rounding."""

    phase: Annotated[float, Signal("1", "dither phase", 0.5)]


class Output(NamedTuple):
    """Dither current."""

    i: Annotated[float, Signal("A", "dither current", 1.0)]


def breakaway_current(
    p: Annotated[float, Signal("Pa", "measured pressure", 2e6)], est_par: Believed
) -> Annotated[float, Signal("A", "breakaway current", 1.0)]:
    r"""Return the breakaway current of the piston.

    .. math:: i_{brkf} = \frac{k_{brk,p}}{K_e} (T_{pr} + f_{cfr,p} p_{mc})

    As in the paper, the gear efficiency is neglected. Negative pressure is treated as zero.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (18) and (19).
    """
    torque = est_par.T_pr + est_par.f_cfr_p * ops.fmax(p, 0.0)
    return est_par.k_brk_p * torque / est_par.K_e


def output(
    x: State,
    p: Annotated[float, Signal("Pa", "measured pressure", 2e6)],
    T: SampleTime,
    par: Parameters,
    est_par: Believed,
) -> tuple[State, Output]:
    r"""Advance the dither by one sample.

    If a phase differs from the end of a period or half period only by rounding, it is treated as
    this end. A square wave then has the same number of samples above and below zero.

    .. math:: i_{dit}(t) = A_{dit} \sin(2 \pi f_{dit} t), \quad A_{dit} = i_{brkf}

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (20).
    """
    advanced = x.phase + par.f_dit * T
    amplitude = par.gain * breakaway_current(p, est_par)
    wave = _wave(x.phase, par.waveform)
    periods = ops.floor(advanced + _ROUNDING)
    return State(phase=advanced - periods), Output(i=amplitude * wave)


def _wave(phase: float, waveform: str) -> float:
    if waveform == "off":
        return 0.0 * phase
    if waveform == "square":
        return ops.where(phase < 0.5 - _ROUNDING, 1.0, -1.0)
    if waveform == "triangle":
        return ops.where(
            phase < 0.25, 4.0 * phase, ops.where(phase < 0.75, 2.0 - 4.0 * phase, 4.0 * phase - 4.0)
        )
    return ops.sin(2.0 * math.pi * phase)
