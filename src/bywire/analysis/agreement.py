"""Agreement of the nonlinear frequency response with the linear model, and what breaks it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.frequency_response import frequency_response
from bywire.analysis.loop import Loop
from bywire.analysis.response_dataset import Sweep
from bywire.core.parameters import ParameterSet

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

_PATIENCE = 12  # windows granted to loops with friction, which may never repeat exactly
GAIN, PHASE = 0.01, 0.1
"""largest difference of gain [dB] and phase [degree] that counts as agreement"""


@dataclass(frozen=True)
class Agreement:
    """Differences between the nonlinear and the linear response.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (n,).
    gain, phase
        By what is left on (``""``: nothing, ``"all"``: everything, else one cause): measured less
        linear in dB and degree, shape (n,); NaN where the output stuck or did not settle.
    """

    frequencies: Array
    gain: dict[str, Array]
    phase: dict[str, Array]

    @property
    def holds(self) -> bool:
        """Whether the responses agree with everything off."""
        gain, phase = np.abs(self.gain[""]).max(), np.abs(self.phase[""]).max()
        return bool(gain <= GAIN and phase <= PHASE)  # NaN agrees with nothing


def agreement(
    loop: Loop,
    par: ParameterSet,
    value: float,
    frequencies: Sequence[float],
    amplitudes: tuple[float, float],
    step: float = 20e-6,
    progress: Progress | None = None,
) -> Agreement:
    """Compare both responses with all causes of nonlinearity off, each one on, and all on.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point.
    frequencies
        Frequencies [Hz], ascending.
    amplitudes
        Amplitudes of the sine, in the input's SI unit: with everything off (small, or limits
        show), and with anything on (as large as in use, or everything sticks).
    step
        Substep [s]; the current loop wants at most 1/(100 f).

    Raises
    ------
    InputError
        When the operating point does not exist or a frequency is too high.
    """
    linear = loop.closed(par, value)
    gain: dict[str, Array] = {}
    phase: dict[str, Array] = {}
    left = {"": loop.smooth(par), **{c: loop.smooth(par, c) for c in loop.causes}, "all": par}
    found = xr.Dataset()
    for k, (cause, own) in enumerate(left.items()):
        sweep = Sweep(
            loop.inputs, loop.output, frequencies, (amplitudes[1 if cause else 0],), flags=(),
            whole=loop.whole(own), tolerance=1e-3 if cause else 1e-4,
            most=_PATIENCE if cause else 60,
        )  # fmt: skip
        found = frequency_response(loop.point(own, value).run(step), sweep)
        gain[cause], phase[cause] = _difference(found, linear.response(found["frequency"].values))
        if progress is not None:
            progress(f"agreement of loop {loop.name}", (k + 1) / len(left))
    return Agreement(found["frequency"].values, gain, phase)


def _difference(found: xr.Dataset, linear: NDArray[np.complex128]) -> tuple[Array, Array]:
    one = found.isel(variant=0, amplitude=0)
    settled = one["settled"].values > 0
    gain = np.where(settled, one["gain"].values, np.nan)
    ratio = gain * np.exp(1j * np.radians(one["phase"].values)) / linear[:, 0, 0]
    return 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
