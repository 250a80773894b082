/* A plant between the events of a client's solver: modes, derivatives, event indicators.
 *
 * A modal state has dry friction or a limit. Its mode is its direction of motion, 1 or -1, or 0 while
 * it is stuck. A stuck state and its derivative are zero. A stop operator follows its motion in mode
 * 0. In mode 1 or -1, it slips at its width. Contacts are closed or open. Modes change only in event
 * mode. Between events, all equations are smooth except for kinks in the plant's own
 * laws.
 */
#include <stdint.h>

#include "model.h"

void bw_closing(const double *p, const double *x, double *closed);
void bw_equations(const double *p, const double *x, const double *m, const double *closed,
    double *balance, double *mass, double *low, double *high, double *pressed, double *lack);
void bw_widths(const double *p, const double *x, const double *m, const double *closed,
    const double *rate, double *width, double *growth);
void bw_output(const double *p, const double *x, const double *m, const double *closed,
    const double *reaction, double *row);

#define INDICATORS (2 * MODAL + CONTACTS + STOPS)
/* A value exactly on an edge is not beyond it, because a solver that stops there would otherwise find
 * no change. The edges of quantities with rounding errors have a width. For a velocity, the width is
 * a fraction of its usual magnitude: a solver's error when a body breaks away. For an overlap, which
 * is a sum of other quantities, it is a length [m]. */
#define EDGE 1e-300
#define MOTION_EDGE 1e-9
#define CONTACT_EDGE 1e-14
#define WRONG_STATES "wrong number of continuous states"

static const int modal_states[] = MODAL_STATES, stop_states[] = STOP_STATES;
static const double nominals[] = NOMINALS;

typedef struct {
  double p[PARAMETERS + 1], u[STIMULI + 1], state[STATE], row[ROWS + 1];
  double time, events; /* events: number of mode changes */
  double origin, stop; /* client's times of the run's beginning and of its latest end [s] */
  double mode[MODAL + STOPS + 1], closed[CONTACTS + 1], reaction[MODAL + STOPS + 1];
  double width[STOPS + 1], growth[STOPS + 1]; /* of the stop operators, and its derivative */
  double speed[STOPS + 1];                    /* of their motions */
  double rate[STATES], indicator[INDICATORS + 1];
  int32_t is_set;   /* a value has been set since the derivatives were computed */
  int32_t is_stale; /* the rows are older than the derivatives */
  int32_t is_begun; /* the initial values are set */
} run;

#include "values.h"

static double *states(run *r) { return r->state + X_AT; }

static inline double seconds(const run *r) { return r->time; }

/* Derivatives and event indicators. A reaction balances the load on a stuck body. An indicator turns
 * negative if the load exceeds the reaction's bounds, a body reverses, a contact changes, or a stop
 * operator reaches its width or ceases to slip. */
static void evaluate(run *r) {
  double balance[STATES], mass[STATES], low[MODAL + 1], high[MODAL + 1];
  double pressed[CONTACTS + 1], lack[CONTACTS + 1];
  if (!r->is_set) return;
  bw_equations(r->p, states(r), r->state + M_AT, r->closed, balance, mass, low, high, pressed, lack);
  for (int k = 0; k < MODAL; ++k) {
    const int at = modal_states[k];
    const double f = balance[at], mode = r->mode[k];
    r->reaction[k] = mode > 0.0 ? low[k] : mode < 0.0 ? high[k] : -f;
    balance[at] = mode == 0.0 ? 0.0 : f + r->reaction[k];
    r->indicator[2 * k] = mode == 0.0 ? 1.0 : mode * states(r)[at] + MOTION_EDGE * nominals[at];
    r->indicator[2 * k + 1] = mode == 0.0 ? fmin(high[k] + f, -low[k] - f) + EDGE : 1.0;
  }
  for (int k = 0; k < STATES; ++k) r->rate[k] = balance[k] / mass[k];
  bw_widths(r->p, states(r), r->state + M_AT, r->closed, r->rate, r->width, r->growth);
  for (int k = 0; k < STOPS; ++k) {
    const int at = stop_states[k];
    const double mode = r->mode[MODAL + k];
    r->speed[k] = r->rate[at];
    r->reaction[MODAL + k] = mode == 0.0 ? 0.0 : mode * r->growth[k] - r->speed[k];
    r->rate[at] += r->reaction[MODAL + k];
    r->indicator[2 * MODAL + CONTACTS + k] = mode == 0.0
        ? r->width[k] - fabs(states(r)[at]) + MOTION_EDGE * nominals[at]
        : mode * r->speed[k] - r->growth[k] + EDGE;
  }
  for (int k = 0; k < CONTACTS; ++k)
    r->indicator[2 * MODAL + k] = CONTACT_EDGE + (r->closed[k] != 0.0 ? pressed[k] : -lack[k]);
  r->is_set = 0;
  r->is_stale = 1;
}

static void refresh(run *r) {
  evaluate(r);
  if (!r->is_stale) return;
  bw_output(r->p, states(r), r->state + M_AT, r->closed, r->reaction, r->row);
  r->is_stale = 0;
}

/* Set the modes of the stop operators, and the states that slip. Return 1 if a state was changed. */
static int settle_stops(run *r) {
  int is_new = 0;
  r->is_set = 1;
  evaluate(r);
  for (int k = 0; k < STOPS; ++k) {
    double *z = &states(r)[stop_states[k]], *mode = &r->mode[MODAL + k];
    const double width = r->width[k], speed = r->speed[k], was = *z;
    const double side = width > 0.0 ? (*z > 0.0) - (*z < 0.0) : (speed > 0.0) - (speed < 0.0);
    if (*mode * speed - r->growth[k] < 0.0) *mode = 0.0;
    if (*mode == 0.0 && fabs(*z) >= width && side * speed - r->growth[k] > 0.0) *mode = side;
    if (*mode != 0.0) *z = *mode * width;
    else if (fabs(*z) > width) *z = *z > 0.0 ? width : -width;
    is_new |= *z != was;
  }
  return is_new;
}

/* Set the modes that follow from state and inputs. Return 1 if a state was set to zero or a rate may
 * jump, because some clients' solvers restart only if the FMU reports changed states. */
static int settle(run *r) {
  double balance[STATES], mass[STATES], low[MODAL + 1], high[MODAL + 1];
  double pressed[CONTACTS + 1], lack[CONTACTS + 1], mode[MODAL + STOPS + 1], closed[CONTACTS + 1];
  int is_new = r->is_set;
  memcpy(mode, r->mode, sizeof mode);
  memcpy(closed, r->closed, sizeof closed);
  for (int k = 0; k < MODAL; ++k) {
    double *x = &states(r)[modal_states[k]];
    if (mode[k] * *x > 0.0) continue; /* the body keeps moving in its direction */
    is_new |= *x != 0.0;
    *x = 0.0;
    r->mode[k] = 0.0;
  }
  bw_closing(r->p, states(r), r->closed);
  bw_equations(r->p, states(r), r->state + M_AT, r->closed, balance, mass, low, high, pressed, lack);
  for (int k = 0; k < MODAL; ++k) {
    const double f = balance[modal_states[k]];
    if (r->mode[k] == 0.0) r->mode[k] = (f + low[k] > 0.0) - (f + high[k] < 0.0);
  }
  is_new |= settle_stops(r);
  if (memcmp(mode, r->mode, sizeof mode) || memcmp(closed, r->closed, sizeof closed)) {
    r->events += 1.0;
    is_new = 1;
  }
  r->is_set = 1;
  return is_new;
}

static void started(run *r) {
  for (int k = 0; k < MODAL; ++k) {
    const double x = states(r)[modal_states[k]];
    r->mode[k] = (x > 0.0) - (x < 0.0);
  }
  for (int k = 0; k < STOPS; ++k) r->mode[MODAL + k] = 0.0;
  settle(r);
  r->events = 0.0;
  r->time = r->origin;
}

static double *place_of(run *r, unsigned k) {
  const int at = variables[k].index;
  switch (variables[k].place) {
    case PARAMETER: return &r->p[at];
    case IN_STATE: return &r->state[at];
    case IN_ROW: return &r->row[at];
    case IN_RATE: return &r->rate[at];
    case IN_MODE: return &r->mode[at];
    case IN_CLOSED: return &r->closed[at];
    case IN_INDICATOR: return &r->indicator[at];
    default: return &r->events;
  }
}

/* Functions that both versions share; each returns an error message, or NULL for success. */
static const char *take_states(run *r, const double *x, size_t n) {
  if (n != STATES) return WRONG_STATES;
  memcpy(states(r), x, n * sizeof *x);
  r->is_set = 1;
  return NULL;
}

static const char *give_states(run *r, double *x, size_t n) {
  if (n != STATES) return WRONG_STATES;
  memcpy(x, states(r), n * sizeof *x);
  return NULL;
}

static const char *give_rates(run *r, double *rate, size_t n) {
  if (n != STATES) return WRONG_STATES;
  evaluate(r);
  memcpy(rate, r->rate, n * sizeof *rate);
  return NULL;
}

static const char *give_indicators(run *r, double *z, size_t n) {
  if (n != INDICATORS) return "wrong number of event indicators";
  evaluate(r);
  memcpy(z, r->indicator, n * sizeof *z);
  return NULL;
}

static const char *give_nominals(double *x, size_t n) {
  if (n != STATES) return WRONG_STATES;
  memcpy(x, nominals, n * sizeof *x);
  return NULL;
}

/* Return the first state whose derivative is not finite; NULL if all are finite. */
static const char *unknown_rate(const run *r) {
  for (int k = 0; k < STATES; ++k)
    if (!isfinite(r->rate[k])) return state_names[k];
  return NULL;
}
