"""Frequency responses of the nonlinear brake, sine by sine, with dither and friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.harmonics import amplitudes
from bywire.assemblies.motorcycle_brake import MotorcycleBrake
from bywire.assemblies.motorcycle_parameters import DriveMode, MotorcycleParameters
from bywire.bench.motorcycle_case import case_from_rest
from bywire.bench.running import as_run
from bywire.core.errors import ParameterError
from bywire.simulation.run import simulate

Array = NDArray[np.float64]

WINDOW = 4.0
"""time over which every sine is evaluated [s]"""


@dataclass(frozen=True, eq=False)
class SineTest:
    """Response of a signal's fundamental to sines, small or not.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], ascending, shape (n,).
    values
        Complex amplitude of the response over that of the drive, shape (n,).
    """

    frequencies: Array
    values: NDArray[np.complex128]

    def bandwidth(self, drop: float = math.sqrt(0.5), of: float | None = None) -> float:
        """Return where the magnitude has fallen to a share [Hz], straight over log frequency.

        Parameters
        ----------
        drop
            The share, -3 dB by default.
        of
            Magnitude that counts as 1; that of the lowest frequency by default.

        Returns
        -------
        float
            NaN where the response stays above it.
        """
        size = np.abs(self.values)
        level = drop * (size[0] if of is None else of)
        below = np.flatnonzero(size < level)
        if below.size == 0 or below[0] == 0:
            return math.nan
        k = int(below[0])
        share = math.log(size[k - 1] / level) / math.log(size[k - 1] / size[k])
        f = np.log(self.frequencies[k - 1 : k + 1])
        return math.exp(float(f[0] + share * (f[1] - f[0])))


@dataclass(frozen=True)
class Excitation:
    """What shakes the brake.

    Parameters
    ----------
    mode, signal
        Drive mode and the signal of the stimulus that it obeys, for instance ``"pressure"`` and
        ``"p_set"``.
    p
        Pressure at the start [Pa].
    mean, amplitude
        Of the signal, in its SI unit.
    """

    mode: DriveMode
    signal: str
    p: float
    mean: float
    amplitude: float


def sine_test(
    par: MotorcycleParameters,
    excitation: Excitation,
    frequencies: Sequence[float],
    settle: float = 3.0,
) -> SineTest:
    """Return the response of the pressure p_mc to sines around a mean, one run each.

    Parameters
    ----------
    par
        Parameters of the brake.
    excitation
        What shakes it.
    frequencies
        Ascending multiples of 1/WINDOW [Hz], so that every window holds whole periods of the
        sine and of the dither.
    settle
        Time before the window [s].

    Raises
    ------
    ParameterError
        When a frequency is no such multiple.
    KeyboardInterrupt
        When the user stopped a run.
    """
    e, model = excitation, MotorcycleBrake()  # one instance: its kernel is prepared once
    values = []
    for f in frequencies:
        if abs(f * WINDOW - round(f * WINDOW)) > 1e-9:
            raise ParameterError(f"{f:g} Hz is no multiple of {1.0 / WINDOW:g} Hz: round it to one")

        def stimulus(t: Array, f: float = f) -> dict[str, Array]:
            return {e.signal: e.mean + e.amplitude * np.sin(2.0 * math.pi * f * t)}

        case = case_from_rest("sine", par, e.mode, e.p, stimulus, WINDOW, settle=settle)
        found = simulate(as_run(replace(case, model=model), 20e-6), signals=("p_mc",))
        if found.status == "interrupted":
            raise KeyboardInterrupt
        t = found.time - settle
        inside = (t > -1e-9) & (t < WINDOW - 1e-9)
        values.append(amplitudes(t[inside], found["p_mc"][inside], f, 1)[0] / e.amplitude)
    return SineTest(np.array(frequencies, dtype=float), np.array(values))
