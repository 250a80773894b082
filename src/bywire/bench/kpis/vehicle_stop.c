/* How a vehicle with two wheels stops; the definitions are those of vehicle_stop.py. */
#include "smoothing.h"

enum { SPEED, PLACE, BRAKING, PITCH, SUPPORT, HEAT, SLIP = HEAT + 2, OMEGA = SLIP + 2,
  SIGNALS_OF_STOP = OMEGA + 2 };
enum { STOPPING_DISTANCE, STOPPING_TIME, BRAKING_EFFICIENCY, MEAN_DECELERATION, JERK, PEAK_PITCH,
  LIFT_TIME, DISC_ENERGY, PEAK_SLIP, EXCESS_SLIP_TIME = PEAK_SLIP + 2,
  LOCKED_TIME = EXCESS_SLIP_TIME + 2, LONGEST_LOCK = LOCKED_TIME + 2,
  DISC_SHARE = LONGEST_LOCK + 2 };
enum { NO_STOP = 1, NO_IDEAL, NO_WAY, NO_HEAT };
/* what there is instead of figures */
enum { UNSOUND_STOP = 1, NO_ROWS };

/* A stop: its rows from time zero to the standstill are those from `from` to before `until`. */
typedef struct {
  int64_t n, from, until;
  const double *t, *v;
} bw_stop;

/* Return a signal at an instant, straight between samples, as at the ends beyond them. */
static double bw_at(int64_t n, const double *t, const double *y, double instant) {
  const int64_t k = bw_place(n, t, instant, 1) - 1;
  if (k < 0 || k == n - 1 || t[k] == instant) return y[k < 0 ? 0 : k];
  return (y[k + 1] - y[k]) / (t[k + 1] - t[k]) * (instant - t[k]) + y[k];
}

/* Return where a speed that falls to zero is at a level for the first time. */
static double bw_fallen(int64_t n, const double *x, const double *v, double level) {
  int64_t k = 0;
  while (k < n && !(v[k] <= level)) ++k;
  if (k == n) k = 0;
  if (k == 0 || v[k] == level) return x[k];
  return (x[k - 1] - x[k]) / (bw_least(k, v) - v[k]) * (level - v[k]) + x[k];
}

/* Return the first row of standstill, and when that was; n where there is none. */
static int64_t bw_standstill(int64_t n, const double *t, const double *v, double *end) {
  int64_t k = 1;
  while (k < n && !(v[k] <= 0.0 && v[k - 1] > 0.0 && t[k] > 0.0)) ++k;
  *end = k < n ? t[k - 1] + (t[k] - t[k - 1]) * v[k - 1] / (v[k - 1] - v[k]) : 0.0;
  return k;
}

static double bw_jerk(const bw_stop *s, const bw_average *average, const double *a, double *work) {
  const double *t = s->t, *v = s->v;
  const int64_t last = s->n - 1;
  double most = 0.0;
  bw_smoothed(average, s->n, t, a, work);
  for (int64_t k = s->from; k < s->until; ++k) {
    if (!(v[k] > 2.5 && t[k] > 0.3)) continue;
    double before = 0.0, after = 0.0, rising = 0.0, onward = 0.0;
    if (k > 0) before = t[k] - t[k - 1], rising = (work[k] - work[k - 1]) / before;
    if (k < last) after = t[k + 1] - t[k], onward = (work[k + 1] - work[k]) / after;
    const double rate = k == 0 ? onward : k == last ? rising
        : (after * rising + before * onward) / (before + after);
    most = __builtin_fabs(rate) > most ? __builtin_fabs(rate) : most;
  }
  return most;
}

/* Give how a wheel slips and stands above the least speed. */
static void bw_wheel(const bw_figures *to, int64_t wheel, int64_t k, const bw_stop *s,
    const double *slip, const double *omega, double peak) {
  const double *t = s->t, *v = s->v;
  const int64_t last = s->n - 1;
  double most = 0.0, excess = 0.0, locked = 0.0, longest = 0.0;
  int64_t since = -1;
  for (int64_t j = s->from; j < s->until; ++j) {
    const int fast = v[j] > 2.5, stands = fast && omega[j] == 0.0;
    if (fast && slip[j] > most) most = slip[j];
    if (fast && slip[j] > 2.0 * peak && j < last) excess += t[j + 1] - t[j];
    if (stands && j < last) locked += t[j + 1] - t[j];
    if (stands && since < 0) since = j;
    if (!stands) since = -1;
    if (stands) {
      const double lasted = t[j < last ? j + 1 : last] - t[since];
      longest = lasted > longest ? lasted : longest;
    }
  }
  bw_give(to, PEAK_SLIP + wheel, k, most, 0);
  bw_give(to, EXCESS_SLIP_TIME + wheel, k, excess, 0);
  bw_give(to, LOCKED_TIME + wheel, k, locked, 0);
  bw_give(to, LONGEST_LOCK + wheel, k, longest, 0);
}

/* Give how far and how fast the vehicle stops; `end`: when, where it does. */
static void bw_way(const bw_figures *to, int64_t k, const bw_stop *s, const double *x, double end,
    double ideal, int32_t stops) {
  const double way = bw_at(s->n, s->t, x, end) - bw_at(s->n, s->t, x, 0.0);
  const double start = bw_at(s->n, s->t, s->v, 0.0), fast = 0.8 * start, slow = 0.1 * start;
  const double begin = bw_fallen(s->n, x, s->v, fast), until = bw_fallen(s->n, x, s->v, slow);
  bw_give(to, STOPPING_DISTANCE, k, way, stops);
  bw_give(to, STOPPING_TIME, k, end, stops);
  bw_give(to, BRAKING_EFFICIENCY, k, 100.0 * ideal / way,
      stops ? stops : !bw_is_finite(ideal) ? NO_IDEAL : way > 0.0 ? 0 : NO_WAY);
  bw_give(to, MEAN_DECELERATION, k, (fast * fast - slow * slow) / (2.0 * (until - begin)),
      stops ? stops : until > begin ? 0 : NO_WAY);
}

/* `setting`: ideal distance and slip of the peak of each case; `work`: 6 numbers a sample. */
int32_t bw_vehicle_stop(int64_t cases, int64_t n, const double *t, const bw_signal *signals,
    const double *setting, double *work, double *values, int32_t *reasons) {
  const bw_figures to = {values, reasons, cases};
  for (int64_t i = 0; i < SIGNALS_OF_STOP; ++i)
    if (!signals[i].first) return UNSOUND_STOP;
  if (!bw_are_sound(cases, n, t, signals, SIGNALS_OF_STOP)) return UNSOUND_STOP;
  const bw_average average = bw_averaging(n, t, 0.02, work);
  for (int64_t k = 0; k < cases; ++k) {
    bw_stop s = {n, bw_place(n, t, -1e-9, 0), n, t, bw_case(&signals[SPEED], k)};
    double end, heat[2], off = 0.0;
    const int32_t stops = bw_standstill(n, t, s.v, &end) < n ? 0 : NO_STOP;
    if (!stops) s.until = bw_place(n, t, end, 1);
    if (s.from >= s.until) return NO_ROWS;
    bw_way(&to, k, &s, bw_case(&signals[PLACE], k), end, setting[2 * k], stops);
    bw_give(&to, JERK, k, bw_jerk(&s, &average, bw_case(&signals[BRAKING], k), work + 5 * n), 0);
    const double *phi = bw_case(&signals[PITCH], k), *support = bw_case(&signals[SUPPORT], k);
    const double most = bw_largest(s.until - s.from, phi + s.from);
    bw_give(&to, PEAK_PITCH, k, most - bw_at(n, t, phi, 0.0), 0);
    for (int64_t j = s.from; j < s.until && j < n - 1; ++j)
      if (support[j] <= 0.0) off += t[j + 1] - t[j];
    bw_give(&to, LIFT_TIME, k, off, 0);
    for (int64_t w = 0; w < 2; ++w) {
      const double *energy = bw_case(&signals[HEAT + w], k);
      heat[w] = energy[s.until - 1] - energy[s.from];
      bw_wheel(&to, w, k, &s, bw_case(&signals[SLIP + w], k), bw_case(&signals[OMEGA + w], k),
          setting[2 * k + 1]);
    }
    const double every = heat[0] + heat[1];
    bw_give(&to, DISC_ENERGY, k, every, 0);
    for (int64_t w = 0; w < 2; ++w)
      bw_give(&to, DISC_SHARE + w, k, 100.0 * heat[w] / every, every > 0.0 ? 0 : NO_HEAT);
  }
  return 0;
}
