"""Exponential, logarithm, power, sine and cosine, identical on all machines.

The last digit of these functions depends on the system's C library. Here, they are sums and
products in a fixed order, the same as in the kernels (``simulation/c_runtime.py``) and in exported
ECU code. So the results of Python, kernel and target are bit-identical.

References
----------
W. J. Cody and W. Waite, Software Manual for the Elementary Functions, 1980, for the reduction of
arguments in parts. The series are Taylor series, except the Remez polynomial for the exponential.
"""

from __future__ import annotations

import math
import struct

MAGIC = 6755399441055744.0
"""1.5 * 2^52: adding and subtracting it rounds to a whole number"""
LN_2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
QUARTER = (
    0.63661977236758134308,
    1.57079632673412561417e00,
    6.07710050630396597660e-11,
    2.02226624879595063154e-21,
)
"""2/pi, and pi/2 in three parts; the first two times a whole number are exact"""

SMALL = 0.78
"""maximum angle [rad] without a quarter turn to subtract"""
FAR = 1e5
"""angle [rad] above which full turns are subtracted first"""
FAR_PARTS = (102943.70806884766, 3.982688587811367e-06, 1.3253124088109142e-16)
"""2^14 turns in three parts"""
FAR_PERIOD = 1.0 / (2.0 * math.pi * 2.0**14)
LONGEST = 1e11
"""angle [rad] above which the last digit is too coarse to resolve a turn"""
LEAST = 1e-300
"""number below which logarithms come from the C library"""


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
"""coefficients of r^3 to r^11 after 1 + r + r^2/2, from the Remez algorithm with 50 digits; their
relative error is at most 5.9e-18 up to ln(2)/2 (Taylor series up to r^13: 5.7e-18)"""
SINE = _factorials(3, 15, 2, alternates=True)
COSINE = _factorials(2, 16, 2, alternates=True)
LOGARITHM = tuple(2.0 / n for n in range(3, 22, 2))


# --- The functions

_HALF_ROOT = 0.70710678118654757
_UPPER = 0xFFFFFFFFF8000000


def exp(x: float) -> float:
    """Return e to the power of x, with x limited to -708 to 709."""
    x = float(x)
    if x != x:
        return x
    x = min(max(x, -708.0), 709.0)
    t = x * 1.4426950408889634 + MAGIC
    k = t - MAGIC
    r = (x - k * LN_2[0]) - k * LN_2[1]
    r2 = r * r
    r4 = r2 * r2
    r8 = r4 * r4
    e3, e4, e5, e6, e7, e8, e9, e10, e11 = EXPONENTIAL
    a = (1.0 + r) + r2 * (0.5 + r * e3)
    b = (e4 + r * e5) + r2 * (e6 + r * e7)
    c = (e8 + r * e9) + r2 * (e10 + r * e11)
    scale = math.ldexp(1.0, int(k))
    return scale * a + ((scale * r4) * b + (scale * r8) * c)


def sin(x: float) -> float:
    """Return the sine of x [rad]; an angle beyond 1e11 is treated as 0."""
    return _turned(float(x), 0)


def cos(x: float) -> float:
    """Return the cosine of x [rad]; an angle beyond 1e11 is treated as 0."""
    return _turned(float(x), 1)


def _turned(x: float, quarter: int) -> float:
    """Return the sine of x plus a number of quarter turns."""
    r, n = x, quarter
    if abs(x) > SMALL:  # for smaller angles, k is 0
        x = _near(x) if abs(x) > FAR else x
        k = (x * QUARTER[0] + MAGIC) - MAGIC
        r = ((x - k * QUARTER[1]) - k * QUARTER[2]) - k * QUARTER[3]
        n += int(k)
    z = r * r
    if n & 1:
        c2, c4, c6, c8, c10, c12, c14, c16 = COSINE
        y = 1.0 + z * (
            c2 + z * (c4 + z * (c6 + z * (c8 + z * (c10 + z * (c12 + z * (c14 + z * c16))))))
        )
    else:
        s3, s5, s7, s9, s11, s13, s15 = SINE
        y = r + r * z * (s3 + z * (s5 + z * (s7 + z * (s9 + z * (s11 + z * (s13 + z * s15))))))
    return -y if n & 2 else y


def _near(x: float) -> float:
    """Return a large angle minus most of its full turns."""
    if abs(x) > LONGEST:
        return 0.0 * math.sin(x)  # raises ValueError for infinite x
    k = (x * FAR_PERIOD + MAGIC) - MAGIC
    return ((x - k * FAR_PARTS[0]) - k * FAR_PARTS[1]) - k * FAR_PARTS[2]


def _log_parts(a: float) -> tuple[float, float]:
    """Return log a, a > 0, as a sum of two parts; a = m 2^k, m from sqrt(1/2) to sqrt(2)."""
    m, e = math.frexp(a)
    if m < _HALF_ROOT:
        m, e = 2.0 * m, e - 1
    f = m - 1.0
    k = float(e)
    s = f * (1.0 / (2.0 + f))
    z = s * s
    z2 = z * z
    half = 0.5 * f * f
    l3, l5, l7, l9, l11, l13, l15, l17, l19, l21 = LOGARITHM
    p = (l3 + z * l5) + z2 * (
        (l7 + z * l9) + z2 * ((l11 + z * l13) + z2 * ((l15 + z * l17) + z2 * (l19 + z * l21)))
    )
    whole = k * LN_2[0]
    high = whole + f
    low = (f - (high - whole)) + (s * (half + z * p) + k * LN_2[1] - half)
    return high, low


def log(a: float) -> float:
    """Return the natural logarithm of a.

    Raises
    ------
    ValueError
        When a is not > 0.
    """
    a = float(a)
    if not a >= LEAST or math.isinf(a):
        return math.log(a)
    high, low = _log_parts(a)
    return high + low


def power(a: float, b: float) -> float:
    """Return a to the power of b; the product b log a has twice the precision."""
    a, b = float(a), float(b)
    if not a >= LEAST or math.isinf(a) or math.isinf(b):
        return math.pow(a, b)
    log_a, low = _log_parts(a)
    product = b * log_a
    b_h, log_h = _upper(b), _upper(log_a)
    b_l, log_l = b - b_h, log_a - log_h
    lost = ((b_h * log_h - product) + (b_h * log_l + b_l * log_h)) + b_l * log_l
    rest = lost + b * low
    y = product + rest
    found = exp(y)
    return found + found * (rest - (y - product))


def _upper(a: float) -> float:
    """Return the upper half of the significand's bits."""
    (bits,) = struct.unpack("<Q", struct.pack("<d", a))
    (upper,) = struct.unpack("<d", struct.pack("<Q", bits & _UPPER))
    return float(upper)
