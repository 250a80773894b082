/* Moving average over a period, as smoothing.py has it, in the same operations and order. */
#ifndef BYWIRE_SMOOTHING_H
#define BYWIRE_SMOOTHING_H
#include "samples.h"

/* The moving average at every sample: the primitive at both ends of its period, by the interval
 * that an end lies in and its distance from that interval's beginning. The times, and so these, are
 * those of all cases. */
typedef struct {
  double width;
  double *total, *slope, *from, *to;
  int32_t *at_from, *at_to;
} bw_average;

static inline int32_t bw_interval(int64_t n, const double *t, double at, double *distance) {
  int64_t k = bw_place(n, t, at, 1) - 1;
  k = k < 0 ? 0 : k > n - 2 ? n - 2 : k;
  *distance = at - t[k];
  return (int32_t)k;
}

/* `work`: 5 numbers a sample. */
static inline bw_average bw_averaging(int64_t n, const double *t, double period, double *work) {
  const double whole = t[n - 1] - t[0];
  bw_average a = {period < whole ? period : whole, work, work + n, work + 2 * n, work + 3 * n,
      (int32_t *)(work + 4 * n), (int32_t *)(work + 4 * n) + n};
  for (int64_t k = 0; k < n; ++k) {
    double begin = t[k] - 0.5 * a.width;
    begin = begin < t[0] ? t[0] : begin;
    begin = begin > t[n - 1] - a.width ? t[n - 1] - a.width : begin;
    a.at_from[k] = bw_interval(n, t, begin, &a.from[k]);
    a.at_to[k] = bw_interval(n, t, begin + a.width, &a.to[k]);
  }
  return a;
}

/* Integrate a signal up to every sample. */
static inline void bw_primitive(const bw_average *a, int64_t n, const double *restrict t,
    const double *restrict y) {
  double *restrict total = a->total, *restrict slope = a->slope;
  total[0] = 0.0;
  for (int64_t k = 1; k < n; ++k) { /* in vectors, for all that need not wait for the sum */
    slope[k - 1] = (y[k] - y[k - 1]) / (t[k] - t[k - 1]);
    total[k] = 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1]);
  }
  for (int64_t k = 1; k < n; ++k) total[k] += total[k - 1];
}

/* Give the averages of some samples of a signal, once its primitive is there. */
static inline void bw_means(const bw_average *a, int64_t begin, int64_t end,
    const double *restrict y, double *restrict out) {
  const double *restrict total = a->total, *restrict slope = a->slope;
  for (int64_t k = begin; k < end; ++k) {
    const int32_t i = a->at_from[k], j = a->at_to[k];
    const double d = a->from[k], e = a->to[k];
    const double before = total[i] + y[i] * d + 0.5 * slope[i] * (d * d);
    const double until = total[j] + y[j] * e + 0.5 * slope[j] * (e * e);
    out[k] = (until - before) / a->width;
  }
}

static inline void bw_smoothed(const bw_average *a, int64_t n, const double *t, const double *y,
    double *out) {
  bw_primitive(a, n, t, y);
  bw_means(a, 0, n, y, out);
}
#endif
