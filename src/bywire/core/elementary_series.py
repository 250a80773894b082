"""Numbers of the elementary functions: reductions in parts, coefficients of series."""

from __future__ import annotations

import math

MAGIC = 6755399441055744.0
"""1.5 * 2^52: added and taken off again, it leaves a whole number"""
LN_2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
QUARTER = (
    0.63661977236758134308,
    1.57079632673412561417e00,
    6.07710050630396597660e-11,
    2.02226624879595063154e-21,
)
"""2/pi, and pi/2 in three parts, the first two of which a whole number multiplies exactly"""

SMALL = 0.78
"""up to this angle [rad] there are no quarter turns to take off"""
FAR = 1e5
"""beyond this angle [rad] turns are taken off first"""
FAR_PARTS = (102943.70806884766, 3.982688587811367e-06, 1.3253124088109142e-16)
"""2^14 turns in three parts"""
FAR_PERIOD = 1.0 / (2.0 * math.pi * 2.0**14)
LONGEST = 1e11
"""beyond this angle [rad] its last digits are no part of a turn any more"""
LEAST = 1e-300
"""below, logarithms are the C library's"""


def _factorials(first: int, last: int, step: int, alternates: bool) -> tuple[float, ...]:
    signs = (-1.0, 1.0) if alternates else (1.0, 1.0)
    orders = range(first, last + 1, step)
    return tuple(signs[at % 2] / math.factorial(n) for at, n in enumerate(orders))


EXPONENTIAL = (
    0.16666666666666433,
    0.041666666666604,
    0.008333333333499912,
    0.0013888888926778338,
    0.0001984126946643833,
    2.4801508707160782e-05,
    2.755764072946532e-06,
    2.7625176287774916e-07,
    2.497840191042191e-08,
)
"""of r^3 to r^11 behind 1 + r + r^2/2: the least largest relative error up to ln(2)/2, 5.9e-18, by
Remez' exchange in 50 digits; Taylor's series to r^13 has 5.7e-18"""
SINE = _factorials(3, 15, 2, alternates=True)
COSINE = _factorials(2, 16, 2, alternates=True)
LOGARITHM = tuple(2.0 / n for n in range(3, 22, 2))
