/* The kernel's entry for a page: parameters and state lie here, what is long behind __heap_base. */
#include <stdint.h>

#include "model.h"

void bw_run(const double *p, double h, const double *u, double *state, const int64_t *plan,
    const int32_t *selection, double *rec);

#define PAGE(name) __attribute__((export_name(#name)))

static double p[PARAMETERS + 1], state[STATE];
extern unsigned char __heap_base;

PAGE(parameters) double *parameters(void) { return p; }
PAGE(state) double *state_of_run(void) { return state; }
PAGE(room) void *room(void) { return &__heap_base; }

/* Take the initial values of the parameters as they are; those of the bench exactly as it has them,
 * where none is changed. */
PAGE(begin) void begin(int is_changed) {
  for (int k = 0; k < STATE; ++k) state[k] = state_start[k];
  if (is_changed) bw_start(p, state);
}

/* Advance from frame to frame with rows of the stimulus, each for some frames; record every so many
 * frames all signals, in the last frame too where it is asked for. */
PAGE(advance) void advance(const double *u, int32_t held, int32_t first, int32_t end, int32_t last,
    int32_t every, double *rec) {
  static const int64_t frames[] = TASK_FRAMES;
  int32_t selection[ROWS + 1];
  int64_t plan[8 + TASKS + 1] = {first, end, last, SUBSTEPS, held, every,
      (first + every - 1) / every, ROWS};
  for (int k = 0; k < ROWS; ++k) selection[k] = k;
  for (int k = 0; k < TASKS; ++k) plan[8 + k] = frames[k];
  bw_run(p, STEP, u, state, plan, selection, rec);
}
