"""C text at the start of kernels: elementary functions for one lane and for vectors of lanes.

Both use the same source. So a case gives bit-identical results alone and in lanes on every machine.
"""

from __future__ import annotations

_INCLUDES = r"""
#include <stdint.h>
#include <string.h>
#include <math.h>
"""

# Vectors: V contains one double per lane, I one integer, B one truth value. The compiler provides
# arithmetic on vector types. Macros provide all other operations, with the processor's instructions
# where a generic formula would be slow.
_TYPES = r"""
#if defined(__AVX512F__)
#define W 8
#elif defined(__AVX2__)
#define W 4
#else
#define W 2
#endif
typedef double V __attribute__((vector_size(8 * W), aligned(8 * W)));
typedef int64_t I __attribute__((vector_size(8 * W), aligned(8 * W)));
typedef double M __attribute__((vector_size(8 * W), aligned(8), may_alias));  // in memory
#define SET(x) ((V){0} + (x))
#if defined(__AVX512F__)
typedef unsigned char B;
#if defined(__GNUC__) && !defined(__clang__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cmppd512_mask) && __has_builtin(__builtin_ia32_maxpd512_mask)
#define NAMED
#endif
#endif
#if defined(NAMED)
#define INLINE extern inline __attribute__((gnu_inline, always_inline, artificial))
INLINE V any_value(void) { V y = y; return y; }
INLINE B bw_lt(V a, V b) { return __builtin_ia32_cmppd512_mask(a, b, 0x11, (B)-1, 4); }
INLINE B bw_le(V a, V b) { return __builtin_ia32_cmppd512_mask(a, b, 0x12, (B)-1, 4); }
INLINE B bw_eq(V a, V b) { return __builtin_ia32_cmppd512_mask(a, b, 0x00, (B)-1, 4); }
INLINE B bw_ne(V a, V b) { return __builtin_ia32_cmppd512_mask(a, b, 0x04, (B)-1, 4); }
INLINE V bw_select(B m, V a, V b) { return (V)__builtin_ia32_blendmpd_512_mask(a, b, m); }
INLINE V bw_max(V a, V b) { return (V)__builtin_ia32_maxpd512_mask(a, b, any_value(), (B)-1, 4); }
INLINE V bw_min(V a, V b) { return (V)__builtin_ia32_minpd512_mask(a, b, any_value(), (B)-1, 4); }
INLINE V bw_floor(V a) { return (V)__builtin_ia32_rndscalepd_mask(a, 9, any_value(), (B)-1, 4); }
INLINE V bw_sqrt(V a) { return (V)__builtin_ia32_sqrtpd512_mask(a, any_value(), (B)-1, 4); }
INLINE V bw_rcp14(V a) { return (V)__builtin_ia32_rcp14pd512_mask(a, any_value(), (B)-1); }
INLINE V bw_fma(V a, V b, V c) { return (V)__builtin_ia32_vfmaddpd512_mask(a, b, c, (B)-1, 4); }
#define LT(a, b) bw_lt(a, b)
#define LE(a, b) bw_le(a, b)
#define EQ(a, b) bw_eq(a, b)
#define NE(a, b) bw_ne(a, b)
#define SELECT(m, a, b) bw_select(m, b, a)
#define MAX(a, b) bw_max(a, b)
#define MIN(a, b) bw_min(a, b)
#define FLOOR(a) bw_floor(a)
#define SQRT(a) bw_sqrt(a)
#define ESTIMATED(a) bw_rcp14(a)
#define FUSED(a, b, c) bw_fma(a, b, c)
#else
#include <immintrin.h>
#define LT(a, b) _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ)
#define LE(a, b) _mm512_cmp_pd_mask(a, b, _CMP_LE_OQ)
#define EQ(a, b) _mm512_cmp_pd_mask(a, b, _CMP_EQ_OQ)
#define NE(a, b) _mm512_cmp_pd_mask(a, b, _CMP_NEQ_UQ)
#define SELECT(m, a, b) _mm512_mask_blend_pd(m, b, a)
#define MAX(a, b) _mm512_max_pd(a, b)
#define MIN(a, b) _mm512_min_pd(a, b)
#define FLOOR(a) _mm512_roundscale_pd(a, 0x09)
#define SQRT(a) _mm512_sqrt_pd(a)
#define ESTIMATED(a) _mm512_rcp14_pd(a)
#define FUSED(a, b, c) _mm512_fmadd_pd(a, b, c)
#endif
#define NOT(m) ((B)~(m))
#define LANE(m, l) (((m) >> (l)) & 1)
#define EACH_LANE(l, m) for (int left_ = (m), l; left_ && (l = __builtin_ctz(left_), 1); \
    left_ &= left_ - 1)
static inline B ONLY(int l) { return (B)(1 << l); }
/* An estimate of 14 bits and three Newton steps. The last step rounds like a division (Markstein,
 * IBM Journal of Research and Development 34, 1990). This is faster than a division except on
 * processors that divide quickly, where it makes a kernel 10 % slower. */
#if defined(__znver3__) || defined(__znver4__) || defined(__znver5__)
#define INVERSE(a) (1.0 / (a))
#else
static inline V INVERSE(V a) {
  V y = ESTIMATED(a);
  for (int n = 0; n < 3; ++n) y = FUSED(y, FUSED(-a, y, SET(1.0)), y);
  return y;
}
#endif
static inline int ANY(B m) { return m != 0; }
#else
typedef I B;
#define INVERSE(a) (1.0 / (a))
#define LT(a, b) ((a) < (b))
#define LE(a, b) ((a) <= (b))
#define EQ(a, b) ((a) == (b))
#define NE(a, b) ((a) != (b))
#define NOT(m) (~(m))
#define LANE(m, l) ((m)[l] != 0)
#define EACH_LANE(l, m) for (int l = 0; l < W; ++l) if (LANE(m, l))
static inline B ONLY(int l) {
  B m = {0};
  m[l] = -1;
  return m;
}
/* Reading the header of all instructions takes longer than compiling a small kernel. These
 * functions use GCC's built-in names instead, in the same way as the header. */
#if defined(__AVX2__) && defined(__GNUC__) && !defined(__clang__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_blendvpd256) && __has_builtin(__builtin_ia32_maxpd256) \
    && __has_builtin(__builtin_ia32_roundpd256) && __has_builtin(__builtin_ia32_sqrtpd256) \
    && __has_builtin(__builtin_ia32_movmskpd256)
#define NAMED
#endif
#endif
#if defined(NAMED)
#define INLINE extern inline __attribute__((gnu_inline, always_inline, artificial)) V
INLINE bw_select(V a, V b, V m) { return (V)__builtin_ia32_blendvpd256(a, b, m); }
INLINE bw_max(V a, V b) { return (V)__builtin_ia32_maxpd256(a, b); }
INLINE bw_min(V a, V b) { return (V)__builtin_ia32_minpd256(a, b); }
INLINE bw_floor(V a) { return (V)__builtin_ia32_roundpd256(a, 1); }
INLINE bw_sqrt(V a) { return (V)__builtin_ia32_sqrtpd256(a); }
#define SELECT(m, a, b) bw_select(b, a, (V)(m))
#define MAX(a, b) bw_max(a, b)
#define MIN(a, b) bw_min(a, b)
#define FLOOR(a) bw_floor(a)
#define SQRT(a) bw_sqrt(a)
#define ANY(m) (__builtin_ia32_movmskpd256((V)(m)) != 0)
#elif defined(__AVX2__)
#include <immintrin.h>
#define SELECT(m, a, b) _mm256_blendv_pd(b, a, (V)(m))
#define MAX(a, b) _mm256_max_pd(a, b)
#define MIN(a, b) _mm256_min_pd(a, b)
#define FLOOR(a) _mm256_floor_pd(a)
#define SQRT(a) _mm256_sqrt_pd(a)
#define ANY(m) (_mm256_movemask_pd((V)(m)) != 0)
#else
#define SELECT(m, a, b) ((V)(((I)(a) & (m)) | ((I)(b) & ~(m))))
#define MAX(a, b) SELECT((a) > (b), a, b)
#define MIN(a, b) SELECT((a) < (b), a, b)
#define FLOOR(a) each(floor, a)
#define SQRT(a) each(sqrt, a)
static inline int ANY(B m) {
  int64_t any = 0;
  for (int l = 0; l < W; ++l) any |= m[l];
  return any != 0;
}
#endif
#endif
#define FABS(a) ((V)((I)(a) & INT64_MAX))
#define COPYSIGN(a, b) ((V)(((I)(a) & INT64_MAX) | ((I)(b) & INT64_MIN)))
/* Rarely used functions, lane by lane. */
static inline V each(double (*f)(double), V a) {
  for (int l = 0; l < W; ++l) a[l] = f(a[l]);
  return a;
}
#define TAN(a) each(tan, a)
#define ATAN(a) each(atan, a)
#define TANH(a) each(tanh, a)
#define CEIL(a) each(ceil, a)
"""

# exp: x = k ln2 + r, |r| <= ln2/2, a polynomial up to r^11 (error below 2 ulp). The exponent bits
# scale each part of the polynomial, because this function is on the critical path and the scale is
# ready before the polynomial. The rounding constant 1.5 * 2^52 leaves k in the low bits of the sum.
# sin, cos: Cody-Waite reduction by multiples of pi/2 in three parts, valid up to |x| = 1e5; Taylor
# series on |r| <= pi/4 up to r^16. The library computes larger arguments, and powers and logarithms
# near zero. Functions with the suffix "here" are compiled in place.
_FUNCTIONS = r"""
static IN_PLACE V N(exp_within)(V x) {
  const V t = x * 1.4426950408889634 + MAGIC;
  const V k = t - MAGIC;
  const V r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
  const V r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
  const V a = (1.0 + r) + r2 * (0.5 + r * 0.16666666666666433);
  const V b = (0.041666666666604 + r * 0.008333333333499912)
            + r2 * (0.0013888888926778338 + r * 0.0001984126946643833);
  const V c = (2.4801508707160782e-05 + r * 2.755764072946532e-06)
            + r2 * (2.7625176287774916e-07 + r * 2.497840191042191e-08);
  const V scale = REAL((BITS(t) + 1023) << 52);
  return scale * a + ((scale * r4) * b + (scale * r8) * c);
}
static IN_PLACE V N(exp_here)(V x) {
  return N(exp_within)(WITHIN(x, SET(-708.0), SET(709.0)));
}
static FUNCTION V N(exp)(V x) { return N(exp_here)(x); }

static IN_PLACE PAIR N(sine_cosine)(V x) {
  const V t = x * 0.63661977236758134308 + MAGIC;
  const V k = t - MAGIC;
  const V r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11)
            - k * 2.02226624879595063154e-21;
  const V z = r * r;
  const V s = r + r * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0
      + z * (1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0
      + z * (-1.0 / 1307674368000.0)))))));
  const V c = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0
      + z * (-1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0
      + z * (1.0 / 20922789888000.0))))))));
  const I n = BITS(t), odd = -(n & 1), sine = BITS(s), cosine = BITS(c);
  const V y = REAL(((cosine & odd) | (sine & ~odd)) ^ ((n & 2) << 62));
  const V w = REAL(((sine & odd) | (cosine & ~odd)) ^ (((n + 1) & 2) << 62));
  PAIR both;
  FIRST(both) = BEYOND(sin, LT(SET(1e5), FABS(x)), x, y);
  SECOND(both) = BEYOND(cos, LT(SET(1e5), FABS(x)), x, w);
  return both;
}

static IN_PLACE V N(sin_here)(V x) { const PAIR y = N(sine_cosine)(x); return FIRST(y); }
static IN_PLACE V N(cos_here)(V x) { const PAIR y = N(sine_cosine)(x); return SECOND(y); }
static SHARED PAIR N(turned)(V x) { return N(sine_cosine)(x); }
static inline V N(sin)(V x) { const PAIR y = N(turned)(x); return FIRST(y); }
static inline V N(cos)(V x) { const PAIR y = N(turned)(x); return SECOND(y); }

/* log a, a > 0, as *low plus the result, with a = m 2^k, m from sqrt(1/2) to sqrt(2), f = m - 1.
 * With s = f/(2 + f): log m = f - f^2/2 + s (f^2/2 + z p(z)), z = s^2, Taylor series of atanh up to
 * s^21. */
static inline V N(log_parts)(V a, V *low) {
  const I e = (BITS(a) - 0x3FE6A09E667F3BCDLL) >> 52;
  const V f = REAL(BITS(a) - (e << 52)) - 1.0;
  const V k = REAL(BITS(SET(MAGIC)) + e) - MAGIC;
  const V s = f * INVERSE(2.0 + f), z = s * s, z2 = z * z, half = 0.5 * f * f;
  const V p = (2.0 / 3.0 + z * (2.0 / 5.0)) + z2 * ((2.0 / 7.0 + z * (2.0 / 9.0))
      + z2 * ((2.0 / 11.0 + z * (2.0 / 13.0)) + z2 * ((2.0 / 15.0 + z * (2.0 / 17.0))
      + z2 * (2.0 / 19.0 + z * (2.0 / 21.0)))));
  const V whole = k * 6.93147180369123816490e-01, high = whole + f;
  *low = (f - (high - whole)) + (s * (half + z * p) + k * 1.90821492927058770002e-10 - half);
  return high;
}

static FUNCTION V N(log)(V a) {
  V low;
  const V high = N(log_parts)(a, &low);
  return BEYOND(log, LT(a, SET(1e-300)), a, high + low);
}

static inline V N(upper)(V a) { return REAL(BITS(a) & ~0x7FFFFFFLL); }

/* a^b for a > 0 as exp(b log a); the product has twice the precision. */
static FUNCTION V N(pow)(V a, V b) {
  V low;
  const V log = N(log_parts)(a, &low), product = b * log;
  const V b_h = N(upper)(b), log_h = N(upper)(log), b_l = b - b_h, log_l = log - log_h;
  const V lost = ((b_h * log_h - product) + (b_h * log_l + b_l * log_h)) + b_l * log_l;
  const V rest = lost + b * low, y = product + rest;
  const V power = N(exp)(y);
  return BEYOND_OF_TWO(pow, LT(a, SET(1e-300)), a, b, power + power * (rest - (y - product)));
}
"""

# Functions for one lane.
ONE_LANE = (
    r"""
#define MAGIC 6755399441055744.0
static inline int64_t bits_of(double x) { int64_t i; memcpy(&i, &x, sizeof(i)); return i; }
static inline double real_of(int64_t i) { double x; memcpy(&x, &i, sizeof(x)); return x; }
static __attribute__((noinline, cold, unused)) double limited(double a, double low, double high) {
  return a > low ? (a < high ? a : high) : low;
}
/* A branch that is never taken costs no time. Two selections would add latency. */
static inline double within(double a, double low, double high) {
  return __builtin_expect(a >= low && a <= high, 1) ? a : limited(a, low, high);
}
#define V double
#define I int64_t
#define N(f) bw_##f
#define FUNCTION __attribute__((noinline, unused))
#define IN_PLACE inline __attribute__((always_inline))
/* Compilers merge two calls of such a function if its result fits into a register. */
#define SHARED __attribute__((noinline, unused, const))
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__)) && !defined(__CUDACC_RTC__)
typedef double bw_pair __attribute__((vector_size(16)));
#define FIRST(both) (both)[0]
#define SECOND(both) (both)[1]
#else
typedef struct { double first, second; } bw_pair;
#define FIRST(both) (both).first
#define SECOND(both) (both).second
#endif
#define PAIR bw_pair
#define SET(x) (x)
#define BITS(x) bits_of(x)
#define REAL(i) real_of(i)
#define LT(a, b) ((a) < (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define FABS(a) fabs(a)
#define WITHIN(a, low, high) within(a, low, high)
#define INVERSE(a) (1.0 / (a))
#define BEYOND(f, c, a, y) ((c) ? f(a) : (y))
#define BEYOND_OF_TWO(f, c, a, b, y) ((c) ? f(a, b) : (y))
"""
    + _FUNCTIONS
    + r"""
#undef V
#undef I
#undef N
#undef FUNCTION
#undef SHARED
#undef PAIR
#undef FIRST
#undef SECOND
#undef SET
#undef BITS
#undef REAL
#undef LT
#undef MAX
#undef MIN
#undef FABS
#undef WITHIN
#undef INVERSE
#undef BEYOND
#undef BEYOND_OF_TWO
"""
)

_ALL_LANES = (
    r"""
#define N(f) lanes_##f
#define FUNCTION inline
#define SHARED IN_PLACE
typedef struct { V first, second; } PAIR;
#define FIRST(both) (both).first
#define SECOND(both) (both).second
#define BITS(x) ((I)(x))
#define WITHIN(a, low, high) MIN(MAX(a, low), high)
#define REAL(i) ((V)(i))
static __attribute__((noinline, cold, unused)) V beyond(double (*f)(double), B c, V a, V y) {
  for (int l = 0; l < W; ++l) if (LANE(c, l)) y[l] = f(a[l]);
  return y;
}
static __attribute__((noinline, cold, unused)) V beyond_of_two(double (*f)(double, double), B c,
    V a, V b, V y) {
  for (int l = 0; l < W; ++l) if (LANE(c, l)) y[l] = f(a[l], b[l]);
  return y;
}
static inline V chosen_beyond(double (*f)(double), B c, V a, V y) {
  return __builtin_expect(ANY(c), 0) ? beyond(f, c, a, y) : y;
}
static inline V chosen_beyond_of_two(double (*f)(double, double), B c, V a, V b, V y) {
  return __builtin_expect(ANY(c), 0) ? beyond_of_two(f, c, a, b, y) : y;
}
#define BEYOND(f, c, a, y) chosen_beyond(f, c, a, y)
#define BEYOND_OF_TWO(f, c, a, b, y) chosen_beyond_of_two(f, c, a, b, y)
"""
    + _FUNCTIONS
    + r"""
#define EXP(x) lanes_exp(x)
#define SIN(x) lanes_sin(x)
#define COS(x) lanes_cos(x)
#define LOG(x) lanes_log(x)
#define POW(a, b) lanes_pow(a, b)

/* c ? exp(x) : 0, skipped if no lane needs it. */
static inline V EXP_WHERE(B c, V x) {
  if (!ANY(c)) return SET(0.0);
  return SELECT(c, EXP(x), SET(0.0));
}
/* The same if c is false for all arguments outside the function's range. */
static inline V EXP_DECAYED(B c, V x) {
  if (!ANY(c)) return SET(0.0);
  return SELECT(c, lanes_exp_within(x), SET(0.0));
}
"""
)

# Declarations for NVRTC, which compiles C++ without headers and has built-in math functions.
CUDA = r"""
typedef int int32_t;
typedef long long int64_t;
typedef unsigned long long uint64_t;
#define restrict __restrict__
#define KERNEL extern "C" __global__
#define LITERAL(type) type
#define INT64_MAX 0x7fffffffffffffff
#define __builtin_memcpy memcpy
#define __builtin_fabs fabs
#define __builtin_sqrt sqrt
"""

SCALAR = _INCLUDES + ONE_LANE
LANES = SCALAR + _TYPES + _ALL_LANES
