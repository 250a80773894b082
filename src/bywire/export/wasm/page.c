/* A run in a page. Its formulas are functions that the loader generates, in the table after NONE.
 * They read and write the working memory: state, parameters and intermediate results. Long arrays
 * are stored after __heap_base. */
#include <stdint.h>

#define PAGE(name) __attribute__((export_name(#name)))
#include "runtime.h"
#include "layout.h"

enum { NONE, KEEP, STEPS, FAST, POSE, EXACT, INTEGRALS, OUTPUT, START, TICK };

static double area[AREA];
extern unsigned char __heap_base;

PAGE(working) double *working(void) { return area; }
PAGE(parameters) double *parameters(void) { return area + P_AT; }
PAGE(room) void *room(void) { return &__heap_base; }

static void compute(int formula) { ((void (*)(void))(intptr_t)formula)(); }

/* Compute the values that depend only on the parameters and on the length of a substep. */
static void keep(double h) {
  if (area[H_AT] == h) return;
  area[H_AT] = h;
  compute(KEEP);
}

static void pass(int formula, double h, const double *x, const double *d) {
  keep(h);
  memcpy(area + X_AT, x, NX * sizeof(double));
  memcpy(area + D_AT, d, NX * sizeof(double));
  compute(formula);
}

static void fast_pass(const double *c, double h, const double *m, const double *x,
    const double *d, double *o) {
  pass(FAST, h, x, d);
  memcpy(o, area + O_AT, RESULTS * sizeof(double));
}

static void exact_pass(const double *c, double h, const double *m, const double *x,
    const double *d, double *o) {
  pass(POSE, h, x, d);
  area[FAILED_AT] = PROJECTED;
  compute(EXACT);
  memcpy(o, area + O_AT, RESULTS * sizeof(double));
}

#include "cut.h"

/* Repeat or shorten a substep. */
static void repeat(void) {
  double x[NX], d[NX], o[RESULTS];
  cuts made;
  memcpy(x, area + X_AT, sizeof(x));
  memcpy(d, area + D_AT, sizeof(d));
  area[COUNTERS_AT] += located(0, STEP, 0, x, d, 0, o, &made);
  area[COUNTERS_AT + 1] += 1.0;
  area[COUNTERS_AT + 2] += made.tries;
  memcpy(area + X_AT, o, FLOW * sizeof(double)); /* x, d and reactions are contiguous */
  for (int k = 0; k < FLOWS; ++k) area[Q_AT + k] += o[FLOW + k];
  keep(STEP);
}

/* Set the initial values for the current parameters. If none was changed, they are bit-identical to
 * the bench's initial values. */
PAGE(begin) void begin(int is_changed) {
  for (int k = 0; k < STATE; ++k) area[k] = state_start[k];
  if (is_changed) compute(START);
}

/* Advance frame by frame; each row of the stimulus applies for a number of frames. Record all
 * signals at a fixed interval of frames, and after the last frame if requested. */
PAGE(advance) void advance(const double *u, int32_t held, int32_t first, int32_t end, int32_t last,
    int32_t every, double *rec) {
  area[H_AT] = 0.0; /* parameters may have changed */
  keep(STEP);
  for (int32_t f = first; f < end + last; ++f) {
    memcpy(area + U_AT, u + f / held * STIMULI, STIMULI * sizeof(double));
    for (int k = 0; k < TASKS; ++k)
      if (f % task_frames[k] == 0) compute(TICK + k);
    if (f % every == 0) {
      compute(OUTPUT);
      memcpy(rec, area + OUT_AT, ROWS * sizeof(double));
      rec += ROWS;
    }
    if (f == end) break;
    memset(area + S_AT, 0, PRODUCTS * sizeof(double));
    for (int left = SUBSTEPS; left > 0;) {
      left = ((int (*)(int))(intptr_t)STEPS)(left);
      if (left-- > 0) repeat();
    }
    compute(INTEGRALS);
  }
}
