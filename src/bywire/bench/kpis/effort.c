/* Currents, powers and energy; the definitions are those of effort.py. */
#include "samples.h"

enum { CURRENT, POWER, ENERGY, SIGNALS_OF_EFFORT };
enum { PEAK_CURRENT, MEAN_CURRENT, PEAK_POWER, MEAN_POWER, DRAWN_ENERGY };
enum { NO_CURRENT = 1, NO_POWER, NO_ENERGY };

int32_t bw_effort(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  (void)setting, (void)work;
  if (!bw_are_sound(cases, n, t, signals, SIGNALS_OF_EFFORT)) return 1;
  const double duration = t[n - 1] - t[0];
  for (int64_t k = 0; k < cases; ++k) {
    double peak = 0.0, mean = 0.0, most = 0.0, drawn = 0.0;
    if (signals[CURRENT].first) {
      const double *i = bw_case(&signals[CURRENT], k);
      double before = peak = __builtin_fabs(i[0]);
      for (int64_t j = 1; j < n; ++j) {
        const double here = __builtin_fabs(i[j]);
        mean += 0.5 * (here + before) * (t[j] - t[j - 1]);
        peak = here > peak ? here : peak;
        before = here;
      }
      mean /= duration;
    }
    if (signals[POWER].first) most = bw_largest(n, bw_case(&signals[POWER], k));
    if (signals[ENERGY].first) {
      const double *E = bw_case(&signals[ENERGY], k);
      drawn = E[n - 1] - E[0];
    } else if (signals[POWER].first) {
      drawn = bw_integral(n, t, bw_case(&signals[POWER], k));
    }
    const int32_t no_current = signals[CURRENT].first ? 0 : NO_CURRENT;
    const int32_t no_power = signals[POWER].first ? 0 : NO_POWER;
    const int32_t no_energy = signals[ENERGY].first || signals[POWER].first ? 0 : NO_ENERGY;
    bw_give(&to, PEAK_CURRENT, k, peak, no_current);
    bw_give(&to, MEAN_CURRENT, k, mean, no_current);
    bw_give(&to, PEAK_POWER, k, most, no_power);
    bw_give(&to, MEAN_POWER, k, drawn / duration, no_energy);
    bw_give(&to, DRAWN_ENERGY, k, drawn, no_energy);
  }
  return 0;
}
