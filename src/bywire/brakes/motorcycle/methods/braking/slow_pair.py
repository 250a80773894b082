"""Eq. (22) of Dardanelli et al. (2010) with its derivatives: over time, and over frequency."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

NAMES = ("K", "tau_L", "T1", "T2", "T_L")
"""gain and time constants of eq. (22), in the order of the paper's xi"""

_STATES, _INPUTS = 6, 2


def response(values: Array, u: Array, interval: float, every: int) -> tuple[Array, Array]:
    r"""Return every so many samples of the response, and its derivatives.

    .. math::
        G = K \frac{1 + s \tau_L}{(1 + s T_1)(1 + s T_2)(1 + s T_L)}, \quad
        \frac{\partial y}{\partial T_k} = -\frac{s}{1 + s T_k} y

    The system begins at rest. Between samples the input runs straight, for which the
    discretization is exact.

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L; SI, shape (5,).
    u
        Input less its value at rest, shape (n,).
    interval
        Sample time [s].
    every
        Samples from one returned to the next; the first is at the start.

    Returns
    -------
    tuple
        Response, shape (1 + (n - 1) // every,), and derivatives, shape (..., 5).

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (22).
    """
    A, B = _realization(values)
    Phi, now, later = _first_order_hold(A, B, interval)
    blocks = (u.size - 1) // every
    begin = u[: blocks * every].reshape(blocks, every)
    end = u[1 : blocks * every + 1].reshape(blocks, every)
    powers = [np.eye(_STATES)]
    for _ in range(every):
        powers.append(Phi @ powers[-1])
    onward = np.array(powers[:every][::-1])
    gain = begin @ (onward @ now) + end @ (onward @ later)
    states = np.zeros((blocks + 1, _STATES))
    for k in range(blocks):
        states[k + 1] = powers[every] @ states[k] + gain[k]
    z = states @ _outputs(values).T
    return z[:, 0], z[:, 1:]


def impulse(values: Array, n: int, interval: float) -> Array:
    """Return the response of samples to a sample of the input, shape (n,).

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L; SI, shape (5,).
    n
        Samples.
    interval
        Sample time [s].
    """
    u = np.zeros(n + 1)
    u[1] = 1.0  # within the record: its input runs up to the sample, and down from it
    return response(values, u, interval, 1)[0][1:]


def _realization(values: Array) -> tuple[Array, Array]:
    """Return the chain of lags, and one more lag of the output for each time constant."""
    K, tau_L, T_1, T_2, T_L = values
    A, B = np.zeros((_STATES, _STATES)), np.zeros(_STATES)
    lags = (T_1, T_2, T_L)
    for k, T in enumerate(lags):
        A[k, k] = -1.0 / T
        if k:
            A[k, k - 1] = 1.0 / T
    B[0] = 1.0 / T_1
    y = _output_row(K, tau_L, T_L)
    for k, T in enumerate(lags):
        A[3 + k] = y / T
        A[3 + k, 3 + k] -= 1.0 / T
    return A, B


def _output_row(K: float, tau_L: float, T_L: float) -> Array:
    row = np.zeros(_STATES)
    row[1], row[2] = K * tau_L / T_L, K * (1.0 - tau_L / T_L)
    return row


def _outputs(values: Array) -> Array:
    """Return rows of the output and of its derivatives by the five values."""
    K, tau_L, T_1, T_2, T_L = values
    y = _output_row(K, tau_L, T_L)
    rows = [y, y / K, _output_row(K, 1.0, T_L) - _output_row(K, 0.0, T_L)]
    for k, T in enumerate((T_1, T_2, T_L)):
        row = -y / T
        row[3 + k] += 1.0 / T
        rows.append(row)
    return np.array(rows)


def _first_order_hold(A: Array, B: Array, interval: float) -> tuple[Array, Array, Array]:
    """Return the transition, and what the input at the begin and at the end of a step adds."""
    from scipy import linalg

    n = _STATES
    M = np.zeros((n + _INPUTS, n + _INPUTS))
    M[:n, :n], M[:n, n], M[n, n + 1] = A * interval, B * interval, 1.0
    E = linalg.expm(M)
    held, risen = E[:n, n], E[:n, n + 1]
    return E[:n, :n], held - risen, risen


def log_response(values: Array, frequencies: Array) -> tuple[NDArray[np.complex128], Array]:
    r"""Return :math:`\ln G` at frequencies [Hz], and its derivatives, complex.

    The real part is the logarithm of the magnitude, the imaginary part the phase [rad].

    Returns
    -------
    tuple
        Shapes (n,) and (n, 5).
    """
    s = 2j * math.pi * frequencies
    K, tau_L, T_1, T_2, T_L = values
    G = np.log(K) + np.log(1.0 + s * tau_L) - sum(np.log(1.0 + s * T) for T in (T_1, T_2, T_L))
    slopes = [np.full(s.size, 1.0 / K + 0j), s / (1.0 + s * tau_L)]
    slopes += [-s / (1.0 + s * T) for T in (T_1, T_2, T_L)]
    return np.asarray(G), np.column_stack(slopes)
