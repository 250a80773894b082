"""Agreement of the nonlinear frequency response with the linear model, and what breaks it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bywire.analysis.loop import Loop
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array, Complex, Progress

if TYPE_CHECKING:
    import xarray as xr

_PATIENCE = 12  # maximum number of windows for loops with friction, which may never repeat exactly
GAIN, PHASE = 0.01, 0.1
"""maximum difference of gain [dB] and phase [degree] that is treated as agreement"""
NOTHING, LIMITS, EVERYTHING = "", "limits", "all"
"""active nonlinearities: none, at a small amplitude; only limits of currents, voltages and rates,
at a large amplitude; all"""


@dataclass(frozen=True)
class Agreement:
    """Differences between the nonlinear and the linear response.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (n,).
    gain, phase
        Measured minus linear response in dB and degree, shape (n,), by active nonlinearities
        (`NOTHING`, `LIMITS`, one cause, `EVERYTHING`). NaN where the output stuck or did not
        settle. The limits act in all cases except `NOTHING`; `beyond_limits` returns the separate
        effect of a cause.
    step_gain, step_phase
        Effect of the finite simulation step on the linear model: midpoint rule minus exact model
        in dB and degree, shape (n,).
    """

    frequencies: Array
    gain: dict[str, Array]
    phase: dict[str, Array]
    step_gain: Array
    step_phase: Array

    @property
    def holds(self) -> bool:
        """Whether the responses agree without nonlinearities."""
        gain, phase = np.abs(self.gain[NOTHING]).max(), np.abs(self.phase[NOTHING]).max()
        return bool(gain <= GAIN and phase <= PHASE)  # NaN does not agree

    def beyond_limits(self, cause: str) -> tuple[Array, Array]:
        """Return the effect of a cause in addition to the limits at the same amplitude.

        Returns
        -------
        tuple
            Differences of gain [dB] and phase [degree, within 180], shape (n,) each.
        """
        turned = self.phase[cause] - self.phase[LIMITS]
        phase = np.remainder(turned + 180.0, 360.0) - 180.0
        return self.gain[cause] - self.gain[LIMITS], np.asarray(phase)

    @property
    def largest(self) -> list[str]:
        """Cause with the largest effect on the response at each frequency, shape (n,).

        Limits count by their own effect, other causes by their additional effect. Causes that make
        the output stick or prevent settling are treated as largest; several are joined. The entry
        is empty if no effect exceeds the tolerance of agreement.
        """
        moves = {LIMITS: (self.gain[LIMITS], self.phase[LIMITS])}
        singles = [c for c in self.gain if c not in (NOTHING, LIMITS, EVERYTHING)]
        moves |= {cause: self.beyond_limits(cause) for cause in singles}
        sizes = {cause: _move(*by) for cause, by in moves.items()}
        causes = []
        for k in range(len(self.frequencies)):
            here = {cause: float(size[k]) for cause, size in sizes.items()}
            lost = [cause for cause, size in here.items() if not math.isfinite(size)]
            most = max(here, key=lambda cause: here[cause])
            gain, phase = (abs(float(by[k])) for by in moves[most])
            causes.append(", ".join(lost) or ("" if gain <= GAIN and phase <= PHASE else most))
        return causes


def agreement(
    loop: Loop,
    par: ParameterSet,
    value: float,
    frequencies: Sequence[float],
    amplitudes: tuple[float, float],
    step: float | None = None,
    progress: Progress | None = None,
) -> Agreement:
    """Compare both responses without nonlinearities, with each one, and with all of them.

    The case without nonlinearities is measured twice: at the small amplitude, where both responses
    must agree, and at the large one, where limits may act.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point.
    frequencies
        Frequencies [Hz], ascending.
    amplitudes
        Two amplitudes of the sine, in the input's SI unit: one small enough to avoid limits, and
        one as large as in use, so that friction does not stick.
    step
        Substep [s]; the operating point's own by default.

    Raises
    ------
    InputError
        When the operating point does not exist or a frequency is too high.
    """
    linear = loop.closed(par, value)
    gain: dict[str, Array] = {}
    phase: dict[str, Array] = {}
    smooth = loop.smooth(par)
    left = {
        NOTHING: smooth,
        LIMITS: smooth,
        **{c: loop.smooth(par, c) for c in loop.causes},
        EVERYTHING: par,
    }
    f = np.zeros(0)
    for k, (cause, variant) in enumerate(left.items()):
        sweep = Sweep(
            loop.inputs,
            loop.output,
            frequencies,
            (amplitudes[1 if cause else 0],),
            flags=(),
            whole=loop.whole(variant),
            tolerance=1e-3 if cause else 1e-4,
            most=_PATIENCE if cause else 60,
        )
        response = frequency_response(loop.point(variant, value).run(step), sweep)
        f = response["frequency"].values
        gain[cause], phase[cause] = _difference(response, linear.response(f))
        if progress is not None:
            progress(f"agreement of loop {loop.name}", (k + 1) / len(left))
    substep = step or loop.point(par, value).step
    ratio = loop.closed(par, value, substep).response(f) / linear.response(f)
    return Agreement(f, gain, phase, *_in_dB_and_degree(ratio[:, 0, 0]))


def _difference(response: xr.Dataset, linear: Complex) -> tuple[Array, Array]:
    part = response.isel(variant=0, amplitude=0)
    settled = part["settled"].values > 0
    gain = np.where(settled, part["gain"].values, np.nan)
    ratio = gain * np.exp(1j * np.radians(part["phase"].values)) / linear[:, 0, 0]
    return _in_dB_and_degree(ratio)


def _in_dB_and_degree(ratio: Complex) -> tuple[Array, Array]:
    return 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))


def _move(gain: Array, phase: Array) -> Array:
    """Return the change of a response in the complex plane, relative to its original magnitude."""
    return np.abs(10.0 ** (gain / 20.0) * np.exp(1j * np.radians(phase)) - 1.0)
