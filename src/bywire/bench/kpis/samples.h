/* Samples of signals over time, as samples.py has them: what C and Python do alike, bit by bit. */
#ifndef BYWIRE_SAMPLES_H
#define BYWIRE_SAMPLES_H
#include <stdint.h>

/* Signals of some cases over the same times. A case's samples stand in one piece, and begin
 * `between` numbers after those of the case before. */
typedef struct {
  const double *first;
  int64_t between;
} bw_signal;

static inline const double *bw_case(const bw_signal *signal, int64_t k) {
  return signal->first + k * signal->between;
}

/* Bits, for compilers take numbers that are none for impossible in what is compiled with a kernel. */
static inline int bw_is_finite(double x) {
  uint64_t bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  return (~bits & 0x7ff0000000000000u) != 0;
}

static inline double bw_no_number(void) {
  const uint64_t bits = 0x7ff8000000000000u;
  double x;
  __builtin_memcpy(&x, &bits, sizeof x);
  return x;
}

static inline int bw_are_finite(const double *y, int64_t n) {
  uint64_t wrong = 0;
  for (int64_t k = 0; k < n; ++k) wrong |= (uint64_t)!bw_is_finite(y[k]);
  return !wrong;
}

/* Return whether samples are usable: times that increase, and numbers. */
static inline int bw_are_sound(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    int64_t count) {
  if (n < 2 || !bw_are_finite(t, n)) return 0;
  for (int64_t k = 1; k < n; ++k)
    if (!(t[k] > t[k - 1])) return 0;
  for (int64_t s = 0; s < count; ++s)
    for (int64_t c = 0; signals[s].first && c < cases; ++c)
      if (!bw_are_finite(bw_case(&signals[s], c), n)) return 0;
  return 1;
}

/* Return the integral over time by the trapezoidal rule, summed in the order of time. */
static inline double bw_integral(int64_t n, const double *t, const double *y) {
  double sum = 0.0;
  for (int64_t k = 1; k < n; ++k) sum += 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1]);
  return sum;
}

static inline double bw_largest(int64_t n, const double *y) {
  double most = y[0];
  for (int64_t k = 1; k < n; ++k) most = y[k] > most ? y[k] : most;
  return most;
}

static inline double bw_least(int64_t n, const double *y) {
  double least = y[0];
  for (int64_t k = 1; k < n; ++k) least = y[k] < least ? y[k] : least;
  return least;
}

/* Return how far a response moves from one half of its steady state's window to the other: by their
 * means, or by extremes of the later half beyond those of the earlier one. */
static inline double bw_drift(int64_t n, const double *t, const double *y) {
  const int64_t k = (n - 1) / 2, later = n - 1 - k;
  if (k < 1) return 0.0;
  const double first = bw_integral(k + 1, t, y) / (t[k] - t[0]);
  const double then = bw_integral(k + 1, t + later, y + later) / (t[n - 1] - t[later]);
  const double below = bw_least(k + 1, y) - bw_least(k + 1, y + later);
  const double above = bw_largest(k + 1, y + later) - bw_largest(k + 1, y);
  const double beyond = below > above ? below : above, apart = __builtin_fabs(then - first);
  return apart > beyond ? apart : beyond;
}

/* Return how far a response goes from its first level. */
static inline double bw_reach(int64_t n, const double *y) {
  double most = 0.0;
  for (int64_t j = 1; j < n; ++j) {
    const double off = __builtin_fabs(y[j] - y[0]);
    most = off > most ? off : most;
  }
  return most;
}

/* Return how many times come before one; those that equal it, too, where they are passed. */
static inline int64_t bw_place(int64_t n, const double *t, double at, int pass_equal) {
  int64_t low = 0, high = n;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (t[middle] < at || (pass_equal && t[middle] == at)) low = middle + 1;
    else high = middle;
  }
  return low;
}

/* Figures of all cases, case after case of each figure, and why one is not defined: 0 where it is. */
typedef struct {
  double *values;
  int32_t *reasons;
  int64_t cases;
} bw_figures;

static inline void bw_give(const bw_figures *to, int64_t figure, int64_t k, double value,
    int32_t reason) {
  to->values[figure * to->cases + k] = reason ? bw_no_number() : value;
  to->reasons[figure * to->cases + k] = reason;
}
#endif
