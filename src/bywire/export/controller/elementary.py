"""Elementary functions of an exported ECU in C: the operations of ``core.elementary``.

They do not call the C library. So the results on every target are bit-identical to Python's.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection, Sequence
from typing import Any

from bywire.core import elementary as double
from bywire.core import elementary_single as single
from bywire.export.controller.c_text import Precision
from bywire.export.controller.contract import LARGEST

MAGNITUDE = frozenset({"whole", "sine", "cosine"})
"""functions that return a magnitude"""
_MAGNITUDE = {"double": "fabs", "float": "fabsf"}
_WHOLE = {"double": ((2.0**31, "int32_t"), (2.0**52, "int64_t")), "single": ((2.0**23, "int32_t"),)}
"""maximum magnitude that integers round; without an FPU for doubles, 64-bit integers take four
times as long as 32-bit integers"""
Literal = Callable[[float], str]


def elementary(wanted: Collection[str], precision: Precision) -> list[str]:
    """Return the C code of functions, given their names in C, in the order of their calls."""
    number = double if precision.name == "double" else single
    real, lit = precision.real, precision.literal
    parts: list[str] = []
    if "whole" in wanted:
        parts.append(_whole(real, lit, _WHOLE[precision.name]))
    if {"sine", "cosine"} & set(wanted):
        parts.append(_turned(real, lit, number))
    for name, quarter in (("sine", "0u"), ("cosine", "1u")):
        if name in wanted:
            parts.append(
                f"static inline {real} {name}({real} x)\n{{\n    return turned(x, {quarter});\n}}"
            )
    if {"logarithm", "power_of"} & set(wanted):
        parts.append(_LOG_PARTS.format(**_log_words(lit)))
    if "logarithm" in wanted:
        parts.append(_LOGARITHM)
    if {"exponential", "power_of"} & set(wanted):
        parts.append(_exponential(precision, lit))
    if "power_of" in wanted:
        parts.append(_POWER)
    return parts


def contract_functions(precision: Precision, has_limits: bool) -> list[str]:
    """Return the C code of the checks around a step, which examine bits without arithmetic.

    The checks detect infinities and NaN even under fast math. They take only a few instructions on
    a processor without an FPU for doubles.
    """
    real, is_double = precision.real, precision.name == "double"
    integer, bits = ("uint64_t", 64) if is_double else ("uint32_t", 32)
    upper = "(uint32_t)(bits >> 32) << 1" if is_double else "bits << 1"

    def magnitude(value: float) -> str:
        return f"0x{_digits(value, is_double) >> (bits - 32) << 1 & 0xFFFFFFFF:08X}u"

    above = 1 << (bits - 1)  # the sign
    infinite = f"0x{_digits(math.inf, is_double):X}u"
    parts = [
        f"""/* Return the upper bits of a magnitude, which are largest for infinity and NaN. */
static inline uint32_t magnitude({real} x)
{{
    {integer} bits;

    (void)memcpy((unsigned char *)&bits, (const unsigned char *)&x, sizeof bits);
    return {upper};
}}

/* Return whether x is a valid input or result, with a magnitude below 1e15. */
static inline bool is_usual({real} x)
{{
    return magnitude(x) < {magnitude(LARGEST)};
}}"""
    ]
    if has_limits:
        parts.append(f"""/*
 * Return a command limited to plus and minus its limit. A limit that is negative or NaN
 * is treated as 0.
 */
static inline {real} within({real} command, {real} limit)
{{
    {integer} bits;
    {integer} most;
    {real} result;

    (void)memcpy((unsigned char *)&bits, (const unsigned char *)&command, sizeof bits);
    (void)memcpy((unsigned char *)&most, (const unsigned char *)&limit, sizeof most);
    if (most > {infinite}) {{
        bits = 0u;
    }} else if ((bits & {above - 1:#x}u) > most) {{
        bits = (bits & {above:#x}u) | most;
    }} else {{
        /* the command is within its limit */
    }}
    (void)memcpy((unsigned char *)&result, (const unsigned char *)&bits, sizeof result);
    return result;
}}""")
    return parts


def _digits(value: float, is_double: bool) -> int:
    """Return the bits of a number as an integer."""
    return int.from_bytes(struct.pack(">d" if is_double else ">f", value), "big")


def _nested(names: Sequence[float], variable: str, lit: Literal) -> str:
    """Return a polynomial in Horner's form, c0 + x * (c1 + x * ...)."""
    *first, last = map(lit, names)
    text = "".join(f"{each} + {variable} * (" for each in first[:-1])
    return f"{text}{first[-1]} + {variable} * {last}{')' * (len(first) - 1)}"


def _whole(real: str, lit: Literal, integers: Sequence[tuple[float, str]]) -> str:
    every = " else ".join(
        f"if (size < {lit(most)}) {{\n        toward_zero = ({real})({integer})x;\n    }}"
        for most, integer in integers
    )
    return f"""/* Return the largest integer that does not exceed x. */
static inline {real} whole({real} x)
{{
    const {real} size = {_MAGNITUDE[real]}(x);
    {real} toward_zero;

    {every} else {{
        toward_zero = x;
    }}
    return (toward_zero > x) ? (toward_zero - {lit(1.0)}) : toward_zero;
}}"""


def _turned(real: str, lit: Literal, number: Any) -> str:
    fabs = _MAGNITUDE[real]
    quarter, far = number.QUARTER, number.FAR_PARTS
    magic, limit = lit(number.MAGIC), lit(number.FAR)
    longest = lit(number.LONGEST)
    period = lit(number.FAR_PERIOD)
    sine = _nested(number.SINE, "z", lit)
    cosine = _nested(number.COSINE, "z", lit)
    return f"""/* Return a large angle minus most full turns; 0 if it exceeds the precision. */
static {real} near_angle({real} x)
{{
    const {real} k = (x * {period} + {magic}) - {magic};
    const {real} near = ((x - k * {lit(far[0])}) - k * {lit(far[1])})
            - k * {lit(far[2])};

    return ({fabs}(x) < {longest}) ? near : {lit(0.0)};
}}

/*
 * Return the sine of x [rad] plus quarter turns. Cody and Waite's method subtracts the quarter
 * turns in parts, and a Taylor series computes the sine of the remainder.
 */
static {real} turned({real} x, uint32_t quarter)
{{
    const {real} size = {fabs}(x);
    {real} r = x;
    uint32_t n = quarter;
    {real} y;

    if (size > {lit(number.SMALL)}) {{
        const {real} angle = (size > {limit}) ? near_angle(x) : x;
        const {real} k = (angle * {lit(quarter[0])} + {magic}) - {magic};
        r = ((angle - k * {lit(quarter[1])}) - k * {lit(quarter[2])})
                - k * {lit(quarter[3])};
        n += (uint32_t)(int32_t)k;
    }}
    const {real} z = r * r;
    if ((n & 1u) == 1u) {{
        y = {lit(1.0)} + z * ({cosine});
    }} else {{
        y = r + r * z * ({sine});
    }}
    return ((n & 2u) == 2u) ? -y : y;
}}"""


def _exponential(precision: Precision, lit: Literal) -> str:
    real = precision.real
    if precision.name == "single":
        low, high = map(lit, single.LIMITS)
        magic, factor, ln_2 = lit(single.MAGIC), lit(single.LOG_2_E), single.LN_2
        e2 = single.EXPONENTIAL
        body = f"{lit(1.0)} + (r + r * r * ({_nested(e2, 'r', lit)}))"
        scale = ("uint32_t", "127", "23")
        series = f"    const {real} y = {body};\n"
        result = "y * scale"
    else:
        low, high = lit(-708.0), lit(709.0)
        magic, factor, ln_2 = lit(double.MAGIC), lit(1.4426950408889634), double.LN_2
        e = dict(zip(range(3, 12), map(lit, double.EXPONENTIAL), strict=True))
        scale = ("uint64_t", "1023", "52")
        series = f"""    const double r2 = r * r;
    const double r4 = r2 * r2;
    const double r8 = r4 * r4;
    const double a = (1.0 + r) + r2 * (0.5 + r * {e[3]});
    const double b = ({e[4]} + r * {e[5]}) + r2 * ({e[6]} + r * {e[7]});
    const double c = ({e[8]} + r * {e[9]}) + r2 * ({e[10]} + r * {e[11]});
"""
        result = "scale * a + ((scale * r4) * b + (scale * r8) * c)"
    integer, bias, shift = scale
    return f"""/* Return e to the power of x, with x limited to {low} and {high}. */
static {real} exponential({real} x)
{{
    const {real} least = (x > {low}) ? x : {low};
    const {real} inside = (least < {high}) ? least : {high};
    const {real} k = (inside * {factor} + {magic}) - {magic};
    const {real} r = (inside - k * {lit(ln_2[0])}) - k * {lit(ln_2[1])};
{series}    const {integer} exponent = ({integer})((int32_t)k + {bias}) << {shift};
    {real} scale;

    (void)memcpy((unsigned char *)&scale, (const unsigned char *)&exponent, sizeof scale);
    return {result};
}}"""


def _log_words(lit: Literal) -> dict[str, str]:
    names = [f"l{n}" for n in range(3, 22, 2)]
    return {
        **dict(zip(names, map(lit, double.LOGARITHM), strict=True)),
        "ln_2_high": lit(double.LN_2[0]),
        "ln_2_low": lit(double.LN_2[1]),
    }


_LOG_PARTS = """/*
 * Return log a, a > 0, as *low plus the result, with a = m 2^k and m from sqrt(1/2) to sqrt(2).
 */
static double log_parts(double a, double *low)
{{
    uint64_t bits;
    double m;

    (void)memcpy((unsigned char *)&bits, (const unsigned char *)&a, sizeof bits);
    const uint64_t lifted = bits + (0x4000000000000000u - 0x3FE6A09E667F3BCDu);
    const int32_t e = (int32_t)(lifted >> 52) - 1024;
    const uint64_t scaled = (lifted & 0x000FFFFFFFFFFFFFu) + 0x3FE6A09E667F3BCDu;
    (void)memcpy((unsigned char *)&m, (const unsigned char *)&scaled, sizeof m);

    const double f = m - 1.0;
    const double k = (double)e;
    const double s = f * (1.0 / (2.0 + f));
    const double z = s * s;
    const double z2 = z * z;
    const double half = 0.5 * f * f;
    const double p = ({l3} + z * {l5}) + z2 * (({l7} + z * {l9})
            + z2 * (({l11} + z * {l13}) + z2 * (({l15} + z * {l17})
            + z2 * ({l19} + z * {l21}))));
    const double whole_part = k * {ln_2_high};
    const double high = whole_part + f;

    *low = (f - (high - whole_part)) + (s * (half + z * p) + k * {ln_2_low} - half);
    return high;
}}"""

_LOGARITHM = """/* Return the natural logarithm of a; values below 1e-300 are treated as 1e-300. */
static double logarithm(double a)
{
    double low;
    const double high = log_parts((a > 1e-300) ? a : 1e-300, &low);

    return high + low;
}"""

_POWER = """/* Return the upper half of the significand's bits. */
static double upper_part(double a)
{
    uint64_t bits;
    double upper;

    (void)memcpy((unsigned char *)&bits, (const unsigned char *)&a, sizeof bits);
    bits &= 0xFFFFFFFFF8000000u;
    (void)memcpy((unsigned char *)&upper, (const unsigned char *)&bits, sizeof upper);
    return upper;
}

/* Return a to the power of b, a >= 0. The product b log a has twice the precision. */
static double power_of(double a, double b)
{
    double result = (b > 0.0) ? 0.0 : 1.0;

    if (a >= 1e-300) {
        double low;
        const double log_a = log_parts(a, &low);
        const double product = b * log_a;
        const double b_high = upper_part(b);
        const double log_high = upper_part(log_a);
        const double b_low = b - b_high;
        const double log_low = log_a - log_high;
        const double lost = ((b_high * log_high - product) + (b_high * log_low + b_low * log_high))
                + b_low * log_low;
        const double rest = lost + b * low;
        const double y = product + rest;
        const double power = exponential(y);

        result = power + power * (rest - (y - product));
    }
    return result;
}"""
