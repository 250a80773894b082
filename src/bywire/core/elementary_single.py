"""Single-precision sine, cosine and exponential, the same as in exported ECU code.

Reductions and series are the same as in `bywire.core.elementary`, with enough terms for 24 bits.
"""

from __future__ import annotations

import math

import numpy as np

_N = np.float32
MAGIC = 12582912.0
"""1.5 * 2^23"""
QUARTER = (
    float(_N(2.0 / math.pi)),
    1.5703125,
    0.00048351287841796875,
    float(_N(3.139164786504813e-07)),
)
SMALL = float(_N(0.78))
FAR = 8192.0
FAR_PARTS = (6432.0, 1.98046875, float(_N(0.0012858018965523715)))
FAR_PERIOD = float(_N(1.0 / 6433.981754551896))
LONGEST = 4e7
SINE = tuple(float(_N(sign / math.factorial(n))) for sign, n in ((-1, 3), (1, 5), (-1, 7), (1, 9)))
COSINE = tuple(
    float(_N(sign / math.factorial(n))) for sign, n in ((-1, 2), (1, 4), (-1, 6), (1, 8))
)
LN_2 = (0.693359375, float(_N(math.log(2.0) - 0.693359375)))
LOG_2_E = float(_N(1.4426950408889634))
EXPONENTIAL = tuple(float(_N(1.0 / math.factorial(n))) for n in range(2, 8))
LIMITS = (-87.0, 88.0)


def exp(x: np.float32) -> np.float32:
    """Return e to the power of x, with x limited to -87 to 88."""
    if x != x:
        return x
    x = min(max(x, _N(LIMITS[0])), _N(LIMITS[1]))
    k = (x * _N(LOG_2_E) + _N(MAGIC)) - _N(MAGIC)
    r = (x - k * _N(LN_2[0])) - k * _N(LN_2[1])
    e2, e3, e4, e5, e6, e7 = map(_N, EXPONENTIAL)
    y = _N(1.0) + (r + r * r * (e2 + r * (e3 + r * (e4 + r * (e5 + r * (e6 + r * e7))))))
    return _N(y * _N(math.ldexp(1.0, int(k))))


def sin(x: np.float32) -> np.float32:
    """Return the sine of x [rad]; an angle beyond 4e7 is treated as 0."""
    return _turned(x, 0)


def cos(x: np.float32) -> np.float32:
    """Return the cosine of x [rad]; an angle beyond 4e7 is treated as 0."""
    return _turned(x, 1)


def _turned(x: np.float32, quarter: int) -> np.float32:
    r, n = x, quarter
    if abs(x) > SMALL:
        x = _near(x) if abs(x) > FAR else x
        p, p1, p2, p3 = map(_N, QUARTER)
        k = (x * p + _N(MAGIC)) - _N(MAGIC)
        r = ((x - k * p1) - k * p2) - k * p3
        n += int(k)
    z = r * r
    if n & 1:
        c2, c4, c6, c8 = map(_N, COSINE)
        y = _N(1.0) + z * (c2 + z * (c4 + z * (c6 + z * c8)))
    else:
        s3, s5, s7, s9 = map(_N, SINE)
        y = r + r * z * (s3 + z * (s5 + z * (s7 + z * s9)))
    return -y if n & 2 else y


def _near(x: np.float32) -> np.float32:
    if abs(x) > LONGEST:
        return _N(0.0)
    p1, p2, p3 = map(_N, FAR_PARTS)
    k = (x * _N(FAR_PERIOD) + _N(MAGIC)) - _N(MAGIC)
    return _N(((x - k * p1) - k * p2) - k * p3)
