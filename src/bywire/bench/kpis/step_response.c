/* How fast, how exactly, how calmly a step is answered; the definitions are those of
 * step_response.py and smoothing.py, in the same operations and order. */
#include "smoothing.h"

enum { DEAD_TIME, RISE_TIME, SETTLING_TIME, OVERSHOOT, STEADY_STATE_ERROR, RIPPLE };
enum { T_STEP, SMOOTHING, HAS_START, HAS_END, HAS_WINDOW, WINDOW_BEGIN, WINDOW_END, LEVELS };
enum {
  FLAT = 1, CALM, NEVER_REACHED, THERE_ALREADY, NEVER_SETTLES, SETTLES_LATE, NO_SET_POINT, NO_WINDOW,
  STILL, UNSTEADY, SHORT
};
/* what there is instead of figures */
enum { UNSOUND = 1, STEP_OUTSIDE, WINDOW_EMPTY };

/* A response from the step on, with 0 at its start and 1 at its end. */
typedef struct {
  int64_t n;
  const double *t, *z;
  int32_t blind;
} bw_course;

static double bw_first(const bw_course *c, double level, int32_t *reason) {
  const double *t = c->t, *z = c->z;
  int64_t k = 0;
  while (k < c->n && !(z[k] >= level)) ++k;
  *reason = c->blind ? c->blind : k == c->n ? NEVER_REACHED : k == 0 ? THERE_ALREADY : 0;
  if (*reason) return 0.0;
  const double share = (level - z[k - 1]) / (z[k] - z[k - 1]);
  return t[k - 1] + share * (t[k] - t[k - 1]) - t[0];
}

static double bw_settled(const bw_course *c, int32_t *reason) {
  const double *t = c->t, *z = c->z;
  const int64_t last = c->n - 1;
  int64_t k = last;
  while (k >= 0 && !(__builtin_fabs(z[k] - 1.0) > 0.02)) --k;
  *reason = c->blind ? c->blind : k == last ? NEVER_SETTLES : 0;
  if (*reason || k < 0) return 0.0;
  const double edge = 1.0 + (z[k] - 1.0 < 0.0 ? -0.02 : 0.02);
  const double entry = t[k] + (edge - z[k]) / (z[k + 1] - z[k]) * (t[k + 1] - t[k]);
  if (entry > t[last] - 0.1 * (t[last] - t[0])) *reason = SETTLES_LATE;
  return entry - t[0];
}

/* Give the figures of a case: its response from the step on; `resting`: where it stood before. */
static int32_t bw_judge(const bw_figures *to, int64_t k, int64_t n, const double *t, const double *y,
    const double *setting, double resting, double *z) {
  const int tracks = setting[HAS_END] != 0.0;
  double a = t[n - 1] - 0.2 * (t[n - 1] - t[0]), b = t[n - 1];
  if (setting[HAS_WINDOW] != 0.0) a = setting[WINDOW_BEGIN], b = setting[WINDOW_END];
  const int64_t from = bw_place(n, t, a, 0), until = bw_place(n, t, b, 1), count = until - from;
  const int has_window = count >= 2;
  if (!has_window && !tracks) return WINDOW_EMPTY;
  double mean = 0.0, band = 0.0;
  if (has_window) {
    mean = bw_integral(count, t + from, y + from) / (t[until - 1] - t[from]);
    band = bw_largest(count, y + from) - bw_least(count, y + from);
  }
  const double start = setting[HAS_START] != 0.0 ? setting[LEVELS + 2 * k] : resting;
  const double end = tracks ? setting[LEVELS + 2 * k + 1] : mean;
  const double height = end - start, size = __builtin_fabs(height);
  const double larger = __builtin_fabs(start) > __builtin_fabs(end) ? __builtin_fabs(start)
      : __builtin_fabs(end);
  bw_course c = {n, t, z, 0};
  const int flat = !bw_is_finite(height) || size <= 1e-12 * larger;
  const int still = bw_reach(n, y) <= 0.05 * size;
  const int unsteady = !flat && has_window && bw_drift(count, t + from, y + from) > 0.02 * size;
  if (flat) c.blind = FLAT;
  else if (still) c.blind = STILL;
  else if (!tracks && size <= band) c.blind = CALM;
  else if (!tracks && unsteady) c.blind = UNSTEADY;
  double most = 0.0;
  if (!c.blind) {
    for (int64_t j = 0; j < n; ++j) z[j] = (y[j] - start) / height;
    most = bw_largest(n, z);
  }
  int32_t early, low, high, settles;
  const double first = bw_first(&c, 0.05, &early), tenth = bw_first(&c, 0.1, &low);
  const double nearly = bw_first(&c, 0.9, &high), settling = bw_settled(&c, &settles);
  const double excess = most - 1.0;
  bw_give(to, DEAD_TIME, k, first, early);
  bw_give(to, RISE_TIME, k, nearly - tenth, low ? low : high);
  bw_give(to, SETTLING_TIME, k, settling, settles);
  const int32_t moving = unsteady ? UNSTEADY : 0;
  const int32_t falls_short = settles == NEVER_SETTLES && !(excess > 0.0) ? SHORT : 0;
  bw_give(to, OVERSHOOT, k, 100.0 * (excess > 0.0 ? excess : 0.0),
      c.blind ? c.blind : moving ? moving : falls_short);
  bw_give(to, STEADY_STATE_ERROR, k, __builtin_fabs(end - mean),
      !tracks ? NO_SET_POINT : has_window ? moving : NO_WINDOW);
  bw_give(to, RIPPLE, k, band,
      !has_window ? NO_WINDOW : !tracks && flat ? FLAT : still ? STILL : moving);
  return 0;
}

/* `setting`: what the step was, then start and end of each case; `work`: 8 numbers a sample. */
int32_t bw_step_response(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  const double at = setting[T_STEP], period = setting[SMOOTHING];
  if (!bw_are_sound(cases, n, t, signals, 1)) return UNSOUND;
  if (!(t[0] <= at && at < t[n - 1])) return STEP_OUTSIDE;
  double *smooth = work + 5 * n, *after = work + 6 * n, *z = work + 7 * n;
  bw_average a = {0};
  if (period > 0.0) a = bw_averaging(n, t, period, work);
  const int64_t first = bw_place(n, t, at, 1), here = first - 1, rows = n - here;
  const int64_t earlier = bw_place(n, t, at - 0.5 * period, 0);
  for (int64_t j = 1; j < rows; ++j) after[j] = t[here + j];
  after[0] = at;
  for (int64_t k = 0; k < cases; ++k) {
    const double *y = bw_case(&signals[0], k);
    if (period > 0.0) bw_smoothed(&a, n, t, y, smooth);
    else for (int64_t j = 0; j < n; ++j) smooth[j] = y[j];
    double sum = 0.0, *from = smooth + here;
    for (int64_t j = 0; j < earlier && setting[HAS_START] == 0.0; ++j) sum += smooth[j];
    if (t[here] != at) /* the step's instant takes the place of the sample before it */
      from[0] = (from[1] - from[0]) / (t[first] - t[here]) * (at - t[here]) + from[0];
    const double resting = earlier ? sum / (double)earlier : from[0];
    const int32_t none = bw_judge(&to, k, rows, after, from, setting, resting, z);
    if (none) return none;
  }
  return 0;
}
