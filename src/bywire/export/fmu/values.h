/* Values of a run: initial values, values that a client may set, and checks.
 *
 * model.h contains the data of the model: counts, tables of variables, initial values. The including
 * file defines the type of a run, with the members p, u, state, is_set and is_begun, and the three
 * functions declared here.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MESSAGE 600

static void refresh(run *r);  /* update the results that depend on the values */
static void started(run *r);  /* use the values as initial values */
static double *place_of(run *r, unsigned k);

/* Set the initial values for the current parameters; return 0 if they are not finite. */
static int begin(run *r) {
  double kept[STATE];
  memcpy(kept, r->state, sizeof kept);
  if (memcmp(r->p, p_start, sizeof p_start)) bw_start(r->p, r->state);
  for (int k = 0; k < STATE; ++k) /* keep values that were set: a part's inputs are in the state */
    if (memcmp(&kept[k], &state_start[k], sizeof(double))) r->state[k] = kept[k];
  for (int k = 0; k < STATE; ++k)
    if (!isfinite(r->state[k])) return 0;
  r->is_set = 1;
  started(r);
  r->is_begun = 1;
  return 1;
}

static void reset(run *r) {
  memset(r, 0, sizeof *r);
  memcpy(r->p, p_start, sizeof p_start);
  memcpy(r->state, state_start, sizeof state_start);
  for (int k = 0; k < STIMULI; ++k) r->u[k] = u_start[k];
  r->stop = HUGE_VAL;
  r->is_set = 1;
}

/* Set the client's start time, which is time 0 of the run, and its stop time. */
static const char *timed(run *r, double start, int has_stop, double stop) {
  if (!isfinite(start)) return "the start time must be a finite number";
  if (has_stop && !(stop >= start)) return "the stop time must not be before the start time";
  r->origin = start;
  r->stop = has_stop ? stop : HUGE_VAL;
  return NULL;
}

/* Return the name of a value that is not finite; NULL if all values are finite. */
static const char *lost(const run *r) {
  for (int k = 0; k < STATE; ++k)
    if (!isfinite(r->state[k])) return k < STATES ? state_names[k] : "an integral or the memory";
  return NULL;
}

/* Set a variable. If the value is not valid, write a message to said, which is otherwise empty. */
static void set_value(run *r, unsigned k, double value, int is_running, char *said) {
  const variable *v;
  said[0] = 0;
  if (k >= VARIABLES) {
    snprintf(said, MESSAGE, "no variable has the value reference %u", k);
    return;
  }
  v = &variables[k];
  if (v->kind == RESULT) {
    snprintf(said, MESSAGE, "%s is computed and cannot be set", v->name);
  } else if (v->kind == FIXED && is_running) {
    snprintf(said, MESSAGE, "%s is fixed. Set it before or during initialization", v->name);
  } else if (!isfinite(value) || value < v->low || value > v->high) {
    snprintf(said, MESSAGE, "%s = %.6g%s is not valid: it must be %s", v->name, value,
        v->unit, v->range);
  } else {
    *place_of(r, k) = value;
    r->is_set = 1;
  }
}

/* A saved run. Its bytes are its serialized form, which only the same library can read. */
typedef struct {
  char token[sizeof TOKEN];
  int32_t now;
  run r;
} snapshot;

/* Each of these functions returns an error message, or NULL for success. */
static const char *put_aside(const run *r, int now, void **state) {
  snapshot *kept = *state ? *state : calloc(1, sizeof *kept);
  if (!kept) return "out of memory for the state";
  memcpy(kept->token, TOKEN, sizeof TOKEN);
  kept->now = now;
  kept->r = *r;
  *state = kept;
  return NULL;
}

static const char *taken_back(run *r, int *now, const void *state) {
  const snapshot *kept = state;
  if (!kept || memcmp(kept->token, TOKEN, sizeof TOKEN)) return "the state belongs to another model";
  *now = kept->now;
  *r = kept->r;
  return NULL;
}

static const char *serialized(const void *state, void *bytes, size_t size) {
  if (!state) return "the state is NULL";
  if (size < sizeof(snapshot)) return "the buffer is too small for the state";
  memcpy(bytes, state, sizeof(snapshot));
  return NULL;
}

static const char *deserialized(const void *bytes, size_t size, void **state) {
  snapshot *kept;
  if (size != sizeof *kept || memcmp(bytes, TOKEN, sizeof TOKEN))
    return "the bytes are not a state of this model";
  kept = *state ? *state : malloc(sizeof *kept);
  if (!kept) return "out of memory for the state";
  memcpy(kept, bytes, sizeof *kept);
  *state = kept;
  return NULL;
}
