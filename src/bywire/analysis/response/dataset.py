"""What a sine sweep asks for, and its result as a dataset."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from bywire.analysis.response.saturation import Saturation
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex
from bywire.simulation.ensemble import Variations
from bywire.simulation.run import Run


@dataclass(frozen=True)
class Sweep:
    """What shakes a loop, and how its answer is judged.

    Parameters
    ----------
    inputs
        Signals of the Stimulus that are shaken together; the first gives the unit.
    output
        Signal of the Output that answers.
    frequencies
        Wanted frequencies [Hz], ascending; each is rounded so that a window holds whole periods.
    amplitudes
        Amplitudes of the sine, in the input's SI unit, > 0.
    variations
        Dotted name of a parameter -> one value per variant; empty for the run's own parameters.
    flags
        Outputs that are 0 or 1, whose share of the time is reported, such as ``"stuck"``.
    saturations
        Limits that the model has no such output for, reported likewise.
    least
        Periods in a window, at least.
    shortest
        Length of a window [s], at least.
    whole
        Other frequencies [Hz] of which a window holds whole periods, such as that of a dither.
    tolerance
        A response is settled when the complex amplitude of a window differs from that of the one
        before by less than this share. An encoder's resolution alone may scatter it by 0.3 %.
    most
        Windows after which a response is given up.
    """

    inputs: Sequence[str]
    output: str
    frequencies: Sequence[float]
    amplitudes: Sequence[float]
    variations: Variations | None = None
    flags: Sequence[str] = ("stuck",)
    saturations: Sequence[Saturation] = ()
    least: int = 2
    shortest: float = 0.05
    whole: Sequence[float] = ()
    tolerance: float = 1e-3
    most: int = 60

    @property
    def recorded(self) -> tuple[str, ...]:
        """Outputs that a run must record: the answer first, then flags, then what is limited."""
        limited = [name for limit in self.saturations for name in limit.signals]
        return (self.output, *self.flags, *limited)

    def shares(self, values: Array, matrix: Array, names: Sequence[str]) -> dict[str, Array]:
        """Return the share of the time of every flag and limit, shape (cases,) each.

        Parameters
        ----------
        values
            What was recorded, shape (cases, rows, signals).
        matrix, names
            Parameter vectors, shape (parameters, cases), and the names of their rows.
        """
        k = 1 + len(self.flags)
        means = values[:, :, 1:k].mean(axis=1)
        shares = {f"share_{name}": means[:, j] for j, name in enumerate(self.flags)}
        for limit in self.saturations:
            signals = values[:, :, k : k + len(limit.signals)]
            shares[f"share_{limit.name}"] = limit.share(signals, matrix, names)
            k += len(limit.signals)
        return shares


def as_dataset(
    run: Run, sweep: Sweep, frequencies: list[float], done: list[dict[str, Array]]
) -> xr.Dataset:
    """Return the figures of all frequencies, each of shape (variants, amplitudes), as a dataset."""
    stimuli, outputs = signals_of(run.model.Stimulus), signals_of(run.model.Output)
    ratio = f"({outputs[sweep.output].unit})/({stimuli[sweep.inputs[0]].unit})"
    units = {"phase": "degree", "gain": ratio}
    stacked = {name: np.stack([figures[name] for figures in done], axis=2) for name in done[0]}
    stacked["phase"] = _unwrapped(stacked["phase"])
    variables: dict[str, Any] = {
        name: (("variant", "amplitude", "frequency"), value, {"units": units.get(name, "1")})
        for name, value in stacked.items()
    }
    coordinates: Mapping[str, Any] = {
        "frequency": ("frequency", frequencies, {"units": "Hz"}),
        "amplitude": (
            "amplitude",
            np.asarray(sweep.amplitudes, dtype=float),
            {"units": stimuli[sweep.inputs[0]].unit},
        ),
        **{
            name: ("variant", np.asarray(values, dtype=float))
            for name, values in (sweep.variations or {}).items()
        },
    }
    attributes = {
        "model": run.model.name,
        "inputs": " ".join(sweep.inputs),
        "output": sweep.output,
        "step": run.step,
    }
    return xr.Dataset(variables, coords=dict(coordinates), attrs=attributes)


def _unwrapped(phase: Array) -> Array:
    """Return phases without jumps along frequency, gaps of what sticks left out."""
    unwrapped = phase.copy()
    for index in np.ndindex(phase.shape[:2]):
        known = np.isfinite(phase[index])
        unwrapped[index][known] = np.unwrap(phase[index][known], period=360.0)
    return unwrapped


def complex_values(response: xr.Dataset) -> Complex:
    """Return gain and phase of a response as complex numbers, NaN where the output sticks."""
    return np.asarray(response["gain"].values * np.exp(1j * np.radians(response["phase"].values)))


def response_data(response: xr.Dataset, variant: int = 0, amplitude: int = 0) -> Any:
    """Return one variant and amplitude as ``control.FrequencyResponseData``.

    Frequencies at which the output stuck are left out.
    """
    import control

    part = response.isel(variant=variant, amplitude=amplitude)
    values = complex_values(part)
    known = np.isfinite(values)
    return control.frd(values[known], 2.0 * math.pi * part["frequency"].values[known])
