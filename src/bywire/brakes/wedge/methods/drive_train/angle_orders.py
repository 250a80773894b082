"""Orders of a torque over the angle: which harmonics of a revolution stand out of the noise."""

from __future__ import annotations

import math

import numpy as np

from bywire.core.typing import Array

_FALSE = 1e-3  # chance that noise alone shows an order
_MOST = 8


def amplitudes(angle: Array, torque: Array, highest: int) -> Array:
    """Return the amplitude of every order 1 .. highest, each fitted alone, shape (highest,).

    Parameters
    ----------
    angle
        [rad], shape (n,); spread evenly over whole revolutions, or nearly so.
    torque
        Its mean taken off, shape (n,).
    """
    found = np.empty(highest)
    turn = np.exp(-1j * angle)
    wave = np.ones_like(turn)
    for order in range(highest):
        wave = wave * turn
        found[order] = 2.0 * abs(np.mean(wave * torque))
    return found


def standing_out(angle: Array, torque: Array, highest: int) -> tuple[int, ...]:
    """Return the orders that stand out of the noise, strongest first.

    The power of noise at an order is distributed exponentially, and its mean is the median over
    all orders by log 2; what exceeds it more than chance lets any order do counts. One after the
    other is taken off, so that a strong one does not leak into others.
    """
    left, orders = torque - torque.mean(), list[int]()
    limit = math.log(highest / _FALSE) / math.log(2.0)
    while len(orders) < _MOST:
        power = amplitudes(angle, left, highest) ** 2
        best = int(np.argmax(power)) + 1
        if best in orders or power[best - 1] <= limit * float(np.median(power)):
            break
        orders.append(best)
        A = np.column_stack([f(n * angle) for n in orders for f in (np.cos, np.sin)])
        A = np.column_stack((np.ones(angle.size), A))
        left = torque - A @ np.linalg.lstsq(A, torque, rcond=None)[0]
    return tuple(orders)
