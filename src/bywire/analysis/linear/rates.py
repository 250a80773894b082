"""Poles of sampled models as rates of continuous motions."""

from __future__ import annotations

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.typing import Complex

DEAD = 1e-9
"""poles of less than this size are dead beats: their motion is over within a sample"""
STILL = 1e-6
"""rates of less than this size [1/s] are those of what does not move: integrators at rest"""


def rates(model: LinearModel) -> Complex:
    r"""Return the poles as rates [1/s] of continuous motions, slowest first.

    .. math:: s = \ln(z) / T

    for sampled models; a continuous one has them already. Dead beats are left out. The imaginary
    part is known up to multiples of the sampling frequency only; the least is returned.

    Parameters
    ----------
    model
        Model with n states.

    Returns
    -------
    numpy.ndarray
        Shape (at most n,).
    """
    poles = model.poles()
    if not model.period:
        return poles
    continuous = np.log(poles[np.abs(poles) > DEAD]) / model.period
    return np.asarray(continuous[np.argsort(np.abs(continuous))])
