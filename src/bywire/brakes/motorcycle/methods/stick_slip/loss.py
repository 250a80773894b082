"""What the slips of a ramp say of the friction: their shapes, and the currents that began them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.shooting import Fitted, Shooting
from bywire.brakes.motorcycle.methods.stick_slip.shots import Shot
from bywire.core.typing import Array

_BLOCKS = 250  # at most


class Whitening:
    r"""Makes means of neighboring residuals independent, of size one.

    .. math:: \Sigma = \sigma^2 I + P H H^T P \sigma_i^2

    with the answer H of the pressure to every sample of the current, taken from that to a lasting
    offset as if the slip answered alike at all times; P takes off what a shift in time takes up.

    Parameters
    ----------
    one
        A slip of the model.
    sigma, sigma_i
        Noise of a sample of the pressure [Pa], and of the current [A] that drives the slip; 0
        where none does.
    """

    def __init__(self, fitted: Fitted, sigma: float, sigma_i: float) -> None:
        self._block = max(-(-fitted.residuals.size // _BLOCKS), 1)
        self._sigma = sigma / np.sqrt(self._block)
        self._root = self._root_of(fitted, sigma_i) if sigma_i > 0.0 else None

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (n,) or (n, p), as fewer independent rows."""
        from scipy import linalg

        means: Array = self._means(values) / self._sigma
        if self._root is None:
            return means
        return np.asarray(linalg.solve_triangular(self._root, means, lower=True))

    def _root_of(self, fitted: Fitted, sigma_i: float) -> Array:
        """Return the root of the covariance, in units of the pressure's noise."""
        answer = np.diff(self._means(fitted.answer), prepend=0.0)
        count = answer.size
        back = np.arange(count)[:, None] - np.arange(count)[None, :]
        H = np.where(back >= 0, answer[np.clip(back, 0, count - 1)], 0.0)
        v = self._means(fitted.speed)
        H -= np.outer(v, v @ H) / max(float(v @ v), 1e-300)
        H *= sigma_i / (np.sqrt(self._block) * self._sigma)
        covariance = H @ H.T
        covariance[np.diag_indices(count)] += 1.0
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)

    def _means(self, values: Array) -> Array:
        count = len(values) // self._block
        parts = values[: count * self._block].reshape(count, self._block, *values.shape[1:])
        return np.asarray(parts.mean(axis=1))


@dataclass(frozen=True)
class Noise:
    """How sure the measurements are.

    ``pressure``, ``current``: standard deviation of a sample's noise [Pa], [A]; ``scatter``:
    standard deviation of the current that breaks away, from slip to slip [A].
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
            self._whitenings = [Whitening(fitted, noise.pressure, noise.current) for fitted in fits]

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return residuals and Jacobian: the slips' shapes, then one row for every beginning.

        ``values``: friction parameters, reading of the current's sensor without current [A], and by
        how much the current at its peaks exceeds its mean [A].
        """
        seal, zero, ripple = values[: self._shooting.count], float(values[-2]), float(values[-1])
        driven = zero if self._whitenings is not None else None
        residuals, slopes, begun, begun_slopes = [], [], [], []
        for k, shot in enumerate(self._shots):
            fitted, way = self._shooting.fit(shot, seal, driven), shot.slip.direction
            whiten = (
                Whitening(fitted, self._noise.pressure, 0.0)
                if self._whitenings is None
                else self._whitenings[k]
            )
            sure = self._noise.of_breakaway(shot)
            residuals.append(whiten(fitted.residuals))
            none = np.zeros(fitted.residuals.size)
            slopes.append(whiten(np.column_stack((fitted.slopes, -fitted.by_current, none))))
            begun.append((fitted.breakaway - zero + way * ripple) / sure)
            begun_slopes.append(np.array([*fitted.breakaway_slopes, -1.0, way]) / sure)
        return np.concatenate((*residuals, begun)), np.vstack((*slopes, *begun_slopes))
