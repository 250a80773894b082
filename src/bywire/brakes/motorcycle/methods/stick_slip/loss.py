"""What the slips of a ramp say of the friction: their shapes, and the currents that began them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.shooting import Shooting
from bywire.brakes.motorcycle.methods.stick_slip.shots import Shot
from bywire.brakes.motorcycle.methods.stick_slip.whitening import Whitening
from bywire.core.typing import Array


@dataclass(frozen=True)
class Noise:
    """How sure the measurements are.

    Parameters
    ----------
    pressure, current
        Standard deviation of a sample's noise [Pa], [A].
    scatter
        Standard deviation of the current that breaks away, from slip to slip [A].
    """

    pressure: float
    current: float
    scatter: float

    def of_breakaway(self, shot: Shot) -> float:
        """Return the standard deviation of the current [A] measured where a shot begins.

        Of the end of a line through some noisy samples; of the current's own ripple at rest, since
        which of its peaks breaks the piston away is chance; and of what else scatters.
        """
        read = 2.0 * self.current / np.sqrt(shot.seen)
        ripple = np.sqrt(max(shot.unrest**2 - self.current**2, 0.0))
        return float(np.sqrt(read**2 + ripple**2 + self.scatter**2))


class SlipLoss:
    """Weighted residuals of all slips by friction parameters, the current's zero, and its ripple.

    Parameters
    ----------
    shooting, shots, noise
        The model, the measured slips, and how sure they are.
    weighted_at
        Values at which the weights are taken; the slips are then driven by the measured current,
        and the Jacobian does not know its noise: an instrument. None for the search: slips that
        only the ramp drives, quick and with few minima.
    """

    def __init__(
        self,
        shooting: Shooting,
        shots: Sequence[Shot],
        noise: Noise,
        weighted_at: Array | None = None,
    ) -> None:
        self._shooting, self._shots, self._noise = shooting, shots, noise
        self._whitenings: list[Whitening] | None = None
        if weighted_at is not None:
            zero = float(weighted_at[-2])
            fits = (shooting.fit(s, weighted_at[: shooting.count], zero) for s in shots)
            self._whitenings = [Whitening(one, noise.pressure, noise.current) for one in fits]

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return residuals and Jacobian: the slips' shapes, then one row for every beginning.

        Parameters
        ----------
        values
            Friction parameters, reading of the current's sensor without current [A], and by how
            much the current at its peaks exceeds its mean [A].
        """
        seal, zero, ripple = values[: self._shooting.count], float(values[-2]), float(values[-1])
        driven = zero if self._whitenings is not None else None
        residuals, slopes, begun, begun_slopes = [], [], [], []
        for k, shot in enumerate(self._shots):
            one, way = self._shooting.fit(shot, seal, driven), shot.slip.direction
            whiten = (
                Whitening(one, self._noise.pressure, 0.0)
                if self._whitenings is None
                else self._whitenings[k]
            )
            sure = self._noise.of_breakaway(shot)
            residuals.append(whiten(one.residuals))
            none = np.zeros(one.residuals.size)
            slopes.append(whiten(np.column_stack((one.slopes, -one.by_current, none))))
            begun.append((one.breakaway - zero + way * ripple) / sure)
            begun_slopes.append(np.array([*one.breakaway_slopes, -1.0, way]) / sure)
        return np.concatenate((*residuals, begun)), np.vstack((*slopes, *begun_slopes))
