/* How long a brake is in a mode; the definitions are those of occupation.py. */
#include "samples.h"

enum { STUCK, TIME_STUCK, SAT_CURRENT, SAT_DUTY, SIGNALS_OF_OCCUPATION };
enum { SHARE_STUCK, SHARE_SAT_CURRENT, SHARE_SAT_DUTY };
enum { NO_MODE = 1, OTHER_VALUES };

static void bw_share(const bw_figures *to, int64_t figure, int64_t k, int64_t n, const double *t,
    const bw_signal *mode) {
  if (!mode->first) {
    bw_give(to, figure, k, 0.0, NO_MODE);
    return;
  }
  const double *y = bw_case(mode, k);
  int32_t other = 0;
  for (int64_t j = 0; j < n; ++j) other |= !(y[j] == 0.0 || y[j] == 1.0);
  bw_give(to, figure, k, bw_integral(n, t, y) / (t[n - 1] - t[0]), other ? OTHER_VALUES : 0);
}

int32_t bw_occupation(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  (void)setting, (void)work;
  if (!bw_are_sound(cases, n, t, signals, SIGNALS_OF_OCCUPATION)) return 1;
  for (int64_t k = 0; k < cases; ++k) {
    if (signals[TIME_STUCK].first) {
      const double *since = bw_case(&signals[TIME_STUCK], k);
      bw_give(&to, SHARE_STUCK, k, (since[n - 1] - since[0]) / (t[n - 1] - t[0]), 0);
    } else {
      bw_share(&to, SHARE_STUCK, k, n, t, &signals[STUCK]);
    }
    bw_share(&to, SHARE_SAT_CURRENT, k, n, t, &signals[SAT_CURRENT]);
    bw_share(&to, SHARE_SAT_DUTY, k, n, t, &signals[SAT_DUTY]);
  }
  return 0;
}
