"""C text that kernels start with: elementary functions, from the library or inline for lanes."""

from __future__ import annotations

_INCLUDES = r"""
#include <stdint.h>
#include <string.h>
#include <math.h>
"""

# One lane: the library's functions are faster than any inline polynomial.
SCALAR = (
    _INCLUDES
    + r"""
#define bw_exp exp
#define bw_sin sin
#define bw_cos cos
#define bw_log log
"""
)

# Lanes: inline, branch-free, so that loops over lanes vectorize.
# exp: x = k ln2 + r, |r| <= ln2/2, Taylor to r^13 (error below 1 ulp), scaled by the exponent
# bits. The rounding constant 1.5 * 2^52 leaves k in the low bits of the sum.
# sin, cos: Cody-Waite reduction by multiples of pi/2 in three parts, good to |x| = 1e5;
# Taylor on |r| <= pi/4 to r^17.
LANES = (
    _INCLUDES
    + r"""
static inline int64_t bw_bits(double x) { int64_t i; memcpy(&i, &x, 8); return i; }
static inline double bw_number(int64_t i) { double x; memcpy(&x, &i, 8); return x; }

static inline double bw_exp(double x) {
  x = x < -708.0 ? -708.0 : x;
  x = x > 709.0 ? 709.0 : x;
  const double magic = 6755399441055744.0;
  const double t = x * 1.4426950408889634 + magic;
  const double k = t - magic;
  const double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
  const double r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
  const double a = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6.0));
  const double b = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0));
  const double c = (1.0 / 40320.0 + r * (1.0 / 362880.0))
                 + r2 * (1.0 / 3628800.0 + r * (1.0 / 39916800.0));
  const double d = 1.0 / 479001600.0 + r * (1.0 / 6227020800.0);
  const double y = a + r4 * b + r8 * (c + r4 * d);
  return y * bw_number((bw_bits(t) + 1023) << 52);
}

static inline double bw_turn(double x, int quarter) {
  const double magic = 6755399441055744.0;
  const double t = x * 0.63661977236758134308 + magic;
  const double k = t - magic;
  const double r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11)
                 - k * 2.02226624879595063154e-21;
  const double z = r * r;
  const double s = r + r * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0
      + z * (1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0
      + z * (-1.0 / 1307674368000.0)))))));
  const double c = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0
      + z * (-1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0)))))));
  const int64_t n = bw_bits(t) + quarter;
  const double y = (n & 1) ? c : s;
  return (n & 2) ? -y : y;
}

static inline double bw_sin(double x) { return bw_turn(x, 0); }
static inline double bw_cos(double x) { return bw_turn(x, 1); }
static inline double bw_log(double x) { return log(x); }
"""
)
