/* Between which values a signal stays; the definitions are those of extremes.py. */
#include "samples.h"

enum { OUTPUT_MAX, OUTPUT_MIN };

int32_t bw_extremes(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  (void)setting, (void)work;
  if (!bw_are_sound(cases, n, t, signals, 1)) return 1;
  for (int64_t k = 0; k < cases; ++k) {
    const double *y = bw_case(&signals[0], k);
    bw_give(&to, OUTPUT_MAX, k, bw_largest(n, y), 0);
    bw_give(&to, OUTPUT_MIN, k, bw_least(n, y), 0);
  }
  return 0;
}
