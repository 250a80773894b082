/* A run that a client advances frame by frame with calls of the kernel.
 *
 * A frame is the longest interval that divides the tasks' sample times and the recording interval.
 */
#include <stdint.h>

#include "model.h"

void bw_run(const double *p, double h, const double *u, double *state, const int64_t *plan,
    const int32_t *selection, double *rec);

#define NEVER INT64_MAX

typedef struct {
  double p[PARAMETERS + 1], u[STIMULI + 1], state[STATE], row[ROWS + 1], sampled[ROWS + 1];
  int64_t frame;       /* frames since the start */
  double origin, stop; /* client's times of the run's beginning and of its latest end [s] */
  int32_t is_set;      /* a value has been set since the rows were computed */
  int32_t is_begun;    /* the initial values are set */
  int32_t is_done[TASKS + 1];   /* 3.0: tasks that have ticked at this time */
  int32_t is_active[TASKS + 1]; /* 3.0: tasks that must tick */
} run;

#include "values.h"

/* Frames between the ticks of every task. The value NEVER disables a task's ticks. */
static const int64_t task_frames[] = TASK_FRAMES;

/* Advance from one frame to another. If rows is set, write the recorded signals of these frames, and
 * those of the last frame if requested. Tasks tick in frames that are multiples of their entries. */
static void kernel(const run *r, double *state, int64_t begin, int64_t end, int rows, int last,
    const int64_t *ticks, double *rec) {
  int32_t selection[ROWS + 1];
  int64_t plan[8 + TASKS + 1];
  for (int k = 0; k < ROWS; ++k) selection[k] = k;
  plan[0] = begin;
  plan[1] = end;
  plan[2] = last;
  plan[3] = IS_ECU ? 0 : SUBSTEPS;
  plan[4] = NEVER; /* all frames use one row of the stimulus */
  plan[5] = rows ? 1 : NEVER;
  plan[6] = rows ? begin : 0;
  plan[7] = IS_ECU ? 0 : ROWS;
  for (int k = 0; k < TASKS; ++k) plan[8 + k] = ticks ? ticks[k] : NEVER;
  bw_run(r->p, STEP, r->u, state, plan, selection, rec);
}

/* Compute the recorded signals before any tick that is due at this time. Use frame 1, because every
 * entry divides zero: in frame 0, all tasks would tick. */
static void refresh(run *r) {
  double state[STATE];
  if (!r->is_set) return;
  memcpy(state, r->state, sizeof state);
  if (!IS_ECU) kernel(r, state, 1, 1, 1, 1, NULL, r->row);
  r->is_set = 0;
}

static void started(run *r) {
  r->frame = 0;
  refresh(r);
  memcpy(r->sampled, r->row, sizeof r->row);
}

/* Advance a number of frames, with or without the ticks that are due in them. */
static void advance(run *r, int64_t frames, int has_ticks) {
  const int64_t *ticks = has_ticks ? task_frames : NULL;
  int64_t first = has_ticks ? r->frame : 1; /* without ticks, all frames are the same */
  kernel(r, r->state, first, first + 1, 1, 0, ticks, r->sampled);
  if (frames > 1) {
    double rest[ROWS + 1];
    kernel(r, r->state, first + 1, first + frames, 0, 0, ticks, rest);
  }
  r->frame += frames;
  r->is_set = 1;
  refresh(r);
}

/* Run the ticks of the active tasks now. Their entry is 1, which divides every frame. */
static inline void tick(run *r, const int *is_active) {
  int64_t ticks[TASKS + 1];
  for (int k = 0; k < TASKS; ++k) ticks[k] = is_active[k] ? 1 : NEVER;
  kernel(r, r->state, 1, 1, 1, 1, ticks, r->row);
  memcpy(r->sampled, r->row, sizeof r->row);
  r->is_set = 0;
}

/* The client's time [s]. It is computed from the number of frames. So rounding errors do not
 * accumulate, and results do not depend on the start time. */
static inline double seconds(const run *r) {
  return r->origin + STEP * SUBSTEPS * (double)r->frame;
}

static double unsettled(const run *r) { return r->state[STATE - COUNTERS]; }

static double *place_of(run *r, unsigned k) {
  const int at = variables[k].index;
  switch (variables[k].place) {
    case PARAMETER: return &r->p[at];
    case STIMULUS: return &r->u[at];
    case IN_STATE: return &r->state[at];
    case IN_ROW: return &r->row[at];
    default: return &r->sampled[at];
  }
}

/* Return the number of frames of a step from a time; 0 with a message if the step is not valid. */
static int64_t frames_of(const run *r, double time, double step, char *said) {
  const double frame = STEP * SUBSTEPS, here = seconds(r);
  const double frames = step / frame;
  /* Rounding error of a client's times: of one time, and of the sum of all its steps. */
  const double once = 4.5e-16 * fmax(fabs(here), fabs(r->origin));
  const double often = fmin(1e-6 * frame + once * (double)(r->frame + 1), 0.1 * frame);
  said[0] = 0;
  if (!(isfinite(time) && fabs(time - here) <= often)) {
    snprintf(said, MESSAGE, "the step begins at %.9g s, but the run is at %.9g s", time, here);
    return 0;
  }
  if (!(frames > 0.5 && frames < 1e15 && fabs(frames - round(frames)) <= 1e-6 + 2.0 * once / frame)) {
    snprintf(said, MESSAGE, "a communication step of %.9g s is not valid: it must be a whole "
        "multiple of %.9g s, an interval that divides the ECU's sample times", step, frame);
    return 0;
  }
  if (here + step > r->stop + often) {
    snprintf(said, MESSAGE, "the step ends at %.9g s, but the stop time is %.9g s", here + step,
        r->stop);
    return 0;
  }
  return (int64_t)round(frames);
}
