/* Functional Mock-up Interface 3.0, co-simulation: the functions that an importer calls. They use
 * stepping.h.
 *
 * Without event mode, a step runs the ticks that are due at its beginning and then the substeps.
 * Results are left limits, as in version 2.0. With event mode, the ECU's tasks are clocks, which the
 * importer activates at their times. The results after that event equal those of the bench. The
 * value references are those of fmi3.h, then a clock for every task.
 */
#include "stepping.h"

#define KIND_TEXT "co-simulation"
#include "fmi3.h"

#define CLOCK(k) (TIME + 1 + (k))

API fmi3Instance fmi3InstantiateCoSimulation(const char *name, const char *token,
    const char *resources, bool visible, bool logging, bool event_mode, bool early_return,
    const fmi3ValueReference intermediate[], size_t n, void *environment, logger log,
    void *update) {
  instance *one = instantiated(token, logging, environment, log);
  (void)name, (void)resources, (void)visible, (void)intermediate, (void)n, (void)update;
  if (!one) return NULL;
  one->has_events = event_mode;
  one->may_return_early = early_return;
  return one;
}

API fmi3Instance fmi3InstantiateModelExchange(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, logger log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  return not_this(environment, log);
}

API fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  instance *one = c;
  if (!one->has_events) return refuse(one, fmi3Error, "the FMU was instantiated without event mode");
  one->now = IN_EVENT;
  return fmi3OK;
}

API fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  ((instance *)c)->now = RUNNING;
  return fmi3OK;
}

API fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const bool values[]) {
  instance *one = c;
  char said[MESSAGE];
  if (one->now != IN_EVENT) return refuse(one, fmi3Error, "clocks tick only in event mode");
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "unknown clock");
    if (values[k] && one->r.frame % task_frames[task]) {
      snprintf(said, MESSAGE, "clock %s does not tick at %.9g s. Its interval is %.9g s",
          task_names[task], seconds(&one->r),
          STEP * SUBSTEPS * (double)task_frames[task]);
      return refuse(one, fmi3Error, said);
    }
    one->r.is_active[task] = values[k] && !one->r.is_done[task];
  }
  return fmi3OK;
}

API fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    bool values[]) {
  instance *one = c;
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "unknown clock");
    values[k] = one->r.is_active[task];
  }
  return fmi3OK;
}

API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *again, bool *terminate,
    bool *nominals, bool *states, bool *has_next, double *next) {
  instance *one = c;
  int any = 0;
  if (one->now != IN_EVENT) return refuse(one, fmi3Error, "the FMU is not in event mode");
  for (int k = 0; k < TASKS; ++k) any |= one->r.is_active[k];
  if (any) tick(&one->r, one->r.is_active);
  for (int k = 0; k < TASKS; ++k) {
    one->r.is_done[k] |= one->r.is_active[k];
    one->r.is_active[k] = 0;
  }
  *again = *terminate = *nominals = *states = *has_next = false;
  *next = 0.0;
  return fmi3OK;
}

/* Frames until the next tick of any task, not counting the current frame; NEVER without tasks. */
static int64_t until_tick(const run *r) {
  int64_t nearest = NEVER;
  for (int k = 0; k < TASKS; ++k) {
    const int64_t left = task_frames[k] - r->frame % task_frames[k];
    if (left < nearest) nearest = left;
  }
  return nearest;
}

API fmi3Status fmi3DoStep(fmi3Instance c, double time, double step, bool no_earlier_state,
    bool *needs_event, bool *terminate, bool *returned_early, double *last) {
  instance *one = c;
  run *r = &one->r;
  const int has_ticks = !IS_PLANT && !one->has_events;
  const double before = unsettled(r);
  char said[MESSAGE];
  int64_t frames;
  (void)no_earlier_state;
  *needs_event = *terminate = *returned_early = false;
  *last = seconds(r);
  if (one->now != RUNNING) return refuse(one, fmi3Error, "the FMU is not in step mode");
  frames = frames_of(r, time, step, said);
  if (!frames) return refuse(one, fmi3Error, said);
  if (one->has_events && !IS_PLANT) {
    for (int k = 0; k < TASKS; ++k)
      if (r->frame % task_frames[k] == 0 && !one->r.is_done[k]) {
        snprintf(said, MESSAGE, "clock %s ticks at %.9g s. Activate it in event mode first",
            task_names[k], *last);
        return refuse(one, fmi3Error, said);
      }
    if (frames > until_tick(r)) {
      if (!one->may_return_early)
        return refuse(one, fmi3Error, "a clock ticks within this step. End the step at the tick");
      frames = until_tick(r);
      *returned_early = true;
    }
    *needs_event = frames == until_tick(r);
  }
  advance(r, frames, has_ticks);
  memset(one->r.is_done, 0, sizeof one->r.is_done);
  if (lost(r)) {
    one->now = FAILED;
    snprintf(said, MESSAGE, "the run diverged: %s is not finite", lost(r));
    return refuse(one, fmi3Error, said);
  }
  *last = seconds(r);
  if (unsettled(r) > before)
    return refuse(one, fmi3Warning, "contacts or friction did not settle in some substeps");
  return fmi3OK;
}

API fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    double intervals[], int qualifiers[]) {
  instance *one = c;
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "unknown clock");
    intervals[k] = STEP * SUBSTEPS * (double)task_frames[task];
    qualifiers[k] = 1; /* unchanged, because the interval is constant */
  }
  return fmi3OK;
}

/* Functions of model exchange. */
NOT_OFFERED(fmi3EnterContinuousTimeMode, (fmi3Instance c))
NOT_OFFERED(fmi3CompletedIntegratorStep, (fmi3Instance c))
NOT_OFFERED(fmi3SetTime, (fmi3Instance c))
NOT_OFFERED(fmi3SetContinuousStates, (fmi3Instance c))
NOT_OFFERED(fmi3GetContinuousStateDerivatives, (fmi3Instance c))
NOT_OFFERED(fmi3GetEventIndicators, (fmi3Instance c))
NOT_OFFERED(fmi3GetContinuousStates, (fmi3Instance c))
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, (fmi3Instance c))
NOT_OFFERED(fmi3GetNumberOfEventIndicators, (fmi3Instance c))
NOT_OFFERED(fmi3GetNumberOfContinuousStates, (fmi3Instance c))
