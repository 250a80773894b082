/* How far a step moves what answers it; the definitions are those of static_gain.py,
 * step_response.py and smoothing.py, in the same operations and order. */
#include "smoothing.h"

enum { STATIC_GAIN };
enum { T_STEP, SMOOTHING, HAS_WINDOW, WINDOW_BEGIN, WINDOW_END, DRIVES };
enum { NOTHING_STEPPED = 1, FLAT_RESPONSE, STILL_RESPONSE, CALM_RESPONSE, UNSTEADY_RESPONSE };
/* what there is instead of figures */
enum { UNSOUND = 1, STEP_OUTSIDE, WINDOW_EMPTY };

/* `setting`: what the step was, then its height in each case; `work`: 7 numbers a sample. */
int32_t bw_static_gain(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  const double at = setting[T_STEP], period = setting[SMOOTHING];
  if (!bw_are_sound(cases, n, t, signals, 1)) return UNSOUND;
  const double last = t[n - 1];
  if (!(t[0] <= at && at < last)) return STEP_OUTSIDE;
  double *smooth = work + 5 * n, *after = work + 6 * n;
  bw_average average = {0};
  if (period > 0.0) average = bw_averaging(n, t, period, work);
  const int64_t first = bw_place(n, t, at, 1), here = first - 1, rows = n - here;
  const int64_t earlier = bw_place(n, t, at - 0.5 * period, 0);
  for (int64_t j = 1; j < rows; ++j) after[j] = t[here + j];
  after[0] = at;
  double a = last - 0.2 * (last - at), b = last;
  if (setting[HAS_WINDOW] != 0.0) a = setting[WINDOW_BEGIN], b = setting[WINDOW_END];
  const int64_t from = bw_place(rows, after, a, 0), until = bw_place(rows, after, b, 1);
  if (until - from < 2) return WINDOW_EMPTY;
  for (int64_t k = 0; k < cases; ++k) {
    const double *y = bw_case(&signals[0], k);
    if (period > 0.0) bw_smoothed(&average, n, t, y, smooth);
    else for (int64_t j = 0; j < n; ++j) smooth[j] = y[j];
    double sum = 0.0, *step = smooth + here;
    for (int64_t j = 0; j < earlier; ++j) sum += smooth[j];
    if (t[here] != at) /* the step's instant takes the place of the sample before it */
      step[0] = (step[1] - step[0]) / (t[first] - t[here]) * (at - t[here]) + step[0];
    const double start = earlier ? sum / (double)earlier : step[0];
    const double end = bw_integral(until - from, after + from, step + from)
        / (after[until - 1] - after[from]);
    const double drive = setting[DRIVES + k], size = __builtin_fabs(end - start);
    const double larger = __builtin_fabs(start) > __builtin_fabs(end) ? __builtin_fabs(start)
        : __builtin_fabs(end);
    const int64_t count = until - from;
    const double band = bw_largest(count, step + from) - bw_least(count, step + from);
    const int32_t why = drive == 0.0 ? NOTHING_STEPPED
        : !bw_is_finite(size) || size <= 1e-12 * larger ? FLAT_RESPONSE
        : bw_reach(rows, step) <= 0.05 * size ? STILL_RESPONSE
        : size <= band ? CALM_RESPONSE
        : bw_drift(count, after + from, step + from) > 0.02 * size ? UNSTEADY_RESPONSE : 0;
    bw_give(&to, STATIC_GAIN, k, (end - start) / drive, why);
  }
  return 0;
}
