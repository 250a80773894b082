/* Functional Mock-up Interface 3.0, co-simulation: the functions of an importer, over stepping.h.
 *
 * Without event mode a step does the ticks that are due at its beginning, then the substeps, and
 * results are left limits, as in version 2.0. With event mode the ECU's tasks are clocks: the
 * importer activates them when their time has come, and results after that event are those of the
 * bench. Value references: the variables, then time, then a clock for every task.
 */
#include <stdbool.h>
#include <stddef.h>

#include "stepping.h"

#if defined(_WIN32)
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

#define TIME VARIABLES
#define CLOCK(k) (VARIABLES + 1 + (k))

typedef void *fmi3Instance, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*logger)(void *, fmi3Status, const char *, const char *);
typedef enum { INSTANTIATED, INITIALIZING, IN_EVENT, STEPPING, FAILED } phase;

typedef struct {
  run r;
  int32_t now, is_done[TASKS + 1]; /* is_done: the task has ticked at this time */
  int is_active[TASKS + 1];
} moment;

typedef struct {
  moment m;
  bool is_logging, has_events, may_return_early;
  void *environment;
  logger log;
} instance;

typedef struct {
  char token[sizeof TOKEN];
  moment m;
} snapshot;

static fmi3Status refuse(fmi3Instance c, fmi3Status status, const char *text) {
  const instance *one = c;
  const char *category = status == fmi3Warning ? "logStatusWarning" : "logStatusError";
  if (one->log && (one->is_logging || status >= fmi3Error))
    one->log(one->environment, status, category, text);
  return status;
}

static int is_running(const instance *one) {
  return one->m.now == IN_EVENT || one->m.now == STEPPING;
}

API const char *fmi3GetVersion(void) { return "3.0"; }

API fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t n, const char *const names[]) {
  (void)n, (void)names;
  ((instance *)c)->is_logging = on;
  return fmi3OK;
}

API fmi3Instance fmi3InstantiateCoSimulation(const char *name, const char *token,
    const char *resources, bool visible, bool logging, bool event_mode, bool early_return,
    const fmi3ValueReference intermediate[], size_t n, void *environment, logger log,
    void *update) {
  instance *one = calloc(1, sizeof *one);
  (void)name, (void)resources, (void)visible, (void)intermediate, (void)n, (void)update;
  if (!one) return NULL;
  one->is_logging = logging;
  one->has_events = event_mode;
  one->may_return_early = early_return;
  one->environment = environment;
  one->log = log;
  if (!token || strcmp(token, TOKEN)) {
    refuse(one, fmi3Error, "the instantiation token is not that of this model's description");
    free(one);
    return NULL;
  }
  reset(&one->m.r);
  return one;
}

API fmi3Instance fmi3InstantiateModelExchange(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, logger log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  if (log) log(environment, fmi3Error, "logStatusError", "only co-simulation is offered");
  return NULL;
}

API fmi3Instance fmi3InstantiateScheduledExecution(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, logger log,
    void *update, void *lock, void *unlock) {
  (void)update, (void)lock, (void)unlock;
  return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

API void fmi3FreeInstance(fmi3Instance c) { free(c); }

API fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance,
    double start, bool has_stop, double stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  if (start != 0.0)
    return refuse(c, fmi3Error, "the run starts at time 0 s: the settling of the bench first");
  ((instance *)c)->m.now = INITIALIZING;
  return fmi3OK;
}

API fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  instance *one = c;
  if (!one->m.r.is_begun && !begin(&one->m.r)) {
    one->m.now = FAILED;
    return refuse(one, fmi3Error, "there is no state at rest with these parameters");
  }
  one->m.now = one->has_events ? IN_EVENT : STEPPING;
  return fmi3OK;
}

API fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  instance *one = c;
  if (!one->has_events) return refuse(one, fmi3Error, "it was instantiated without event mode");
  one->m.now = IN_EVENT;
  return fmi3OK;
}

API fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  ((instance *)c)->m.now = STEPPING;
  return fmi3OK;
}

API fmi3Status fmi3Terminate(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

API fmi3Status fmi3Reset(fmi3Instance c) {
  instance *one = c;
  memset(&one->m, 0, sizeof one->m);
  reset(&one->m.r);
  return fmi3OK;
}

/* How many numbers a value reference stands for; 0 where it stands for none. */
static int size_of(fmi3ValueReference vr) {
  return vr < VARIABLES ? sizes[vr] : vr == TIME;
}

API fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    double values[], size_t count) {
  instance *one = c;
  run tried = one->m.r, *r = &one->m.r;
  size_t at = 0;
  if (one->m.now == INITIALIZING && !r->is_begun && begin(&tried)) r = &tried; /* a look ahead */
  else refresh(r);
  for (size_t k = 0; k < n; ++k) {
    const int size = size_of(vr[k]);
    if (!size || at + (size_t)size > count)
      return refuse(one, fmi3Error, "there is no such variable, or no room for its values");
    for (int j = 0; j < size; ++j)
      values[at++] = vr[k] == TIME ? STEP * SUBSTEPS * (double)r->frame
                                   : *place_of(r, vr[k] + (unsigned)j);
  }
  return fmi3OK;
}

API fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const double values[], size_t count) {
  instance *one = c;
  run before = one->m.r; /* all of them, or none */
  char said[MESSAGE] = "there is no such variable, or there are not as many values";
  size_t at = 0;
  for (size_t k = 0; k < n; ++k) {
    const int size = vr[k] == TIME ? 0 : size_of(vr[k]);
    if (!size || at + (size_t)size > count) {
      one->m.r = before;
      return refuse(one, fmi3Error, said);
    }
    for (int j = 0; j < size; ++j) {
      set_value(&one->m.r, vr[k] + (unsigned)j, values[at++], is_running(one), said);
      if (said[0]) {
        one->m.r = before;
        return refuse(one, fmi3Error, said);
      }
    }
  }
  return fmi3OK;
}

API fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const bool values[]) {
  instance *one = c;
  char said[MESSAGE];
  if (one->m.now != IN_EVENT) return refuse(one, fmi3Error, "clocks tick in event mode");
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "there is no such clock");
    if (values[k] && one->m.r.frame % task_frames[task]) {
      snprintf(said, MESSAGE, "clock %s does not tick at %.9g s, but every %.9g s",
          task_names[task], STEP * SUBSTEPS * (double)one->m.r.frame,
          STEP * SUBSTEPS * (double)task_frames[task]);
      return refuse(one, fmi3Error, said);
    }
    one->m.is_active[task] = values[k] && !one->m.is_done[task];
  }
  return fmi3OK;
}

API fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    bool values[]) {
  instance *one = c;
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "there is no such clock");
    values[k] = one->m.is_active[task];
  }
  return fmi3OK;
}

API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *again, bool *terminate,
    bool *nominals, bool *states, bool *has_next, double *next) {
  instance *one = c;
  int any = 0;
  if (one->m.now != IN_EVENT) return refuse(one, fmi3Error, "it is not in event mode");
  for (int k = 0; k < TASKS; ++k) any |= one->m.is_active[k];
  if (any) tick(&one->m.r, one->m.is_active);
  for (int k = 0; k < TASKS; ++k) {
    one->m.is_done[k] |= one->m.is_active[k];
    one->m.is_active[k] = 0;
  }
  *again = *terminate = *nominals = *states = *has_next = false;
  *next = 0.0;
  return fmi3OK;
}

/* Frames until a task ticks next, now apart; NEVER without tasks. */
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
  run *r = &one->m.r;
  const int has_ticks = !IS_PLANT && !one->has_events;
  const double before = unsettled(r);
  char said[MESSAGE];
  int64_t frames;
  (void)no_earlier_state;
  *needs_event = *terminate = *returned_early = false;
  *last = STEP * SUBSTEPS * (double)r->frame;
  if (one->m.now != STEPPING) return refuse(one, fmi3Error, "it is not in step mode");
  frames = frames_of(r, time, step, said);
  if (!frames) return refuse(one, fmi3Error, said);
  if (one->has_events && !IS_PLANT) {
    for (int k = 0; k < TASKS; ++k)
      if (r->frame % task_frames[k] == 0 && !one->m.is_done[k]) {
        snprintf(said, MESSAGE, "clock %s ticks at %.9g s: activate it in event mode first",
            task_names[k], *last);
        return refuse(one, fmi3Error, said);
      }
    if (frames > until_tick(r)) {
      if (!one->may_return_early)
        return refuse(one, fmi3Error, "a clock ticks within this step: end it there");
      frames = until_tick(r);
      *returned_early = true;
    }
    *needs_event = frames == until_tick(r);
  }
  advance(r, frames, has_ticks);
  memset(one->m.is_done, 0, sizeof one->m.is_done);
  if (lost(r)) {
    one->m.now = FAILED;
    snprintf(said, MESSAGE, "the run left the numbers: %s is not finite", lost(r));
    return refuse(one, fmi3Error, said);
  }
  *last = STEP * SUBSTEPS * (double)r->frame;
  if (unsettled(r) > before)
    return refuse(one, fmi3Warning, "contacts or frictions did not settle in some substeps");
  return fmi3OK;
}

API fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  instance *one = c;
  snapshot *kept = *state ? *state : calloc(1, sizeof *kept);
  if (!kept) return refuse(one, fmi3Error, "there is no memory for the state");
  memcpy(kept->token, TOKEN, sizeof TOKEN);
  kept->m = one->m;
  *state = kept;
  return fmi3OK;
}

API fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  instance *one = c;
  const snapshot *kept = state;
  if (!kept || memcmp(kept->token, TOKEN, sizeof TOKEN))
    return refuse(one, fmi3Error, "the state is not one of this model");
  one->m = kept->m;
  return fmi3OK;
}

API fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  if (state) free(*state), *state = NULL;
  return fmi3OK;
}

API fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(snapshot);
  return fmi3OK;
}

API fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, uint8_t bytes[],
    size_t size) {
  if (size < sizeof(snapshot)) return refuse(c, fmi3Error, "there is no room for the state");
  memcpy(bytes, state, sizeof(snapshot));
  return fmi3OK;
}

API fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t bytes[], size_t size,
    fmi3FMUState *state) {
  snapshot *kept;
  if (size != sizeof *kept || memcmp(bytes, TOKEN, sizeof TOKEN))
    return refuse(c, fmi3Error, "the bytes are not a state of this model");
  kept = *state ? *state : malloc(sizeof *kept);
  if (!kept) return refuse(c, fmi3Error, "there is no memory for the state");
  memcpy(kept, bytes, sizeof *kept);
  *state = kept;
  return fmi3OK;
}

API fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    double intervals[], int qualifiers[]) {
  instance *one = c;
  for (size_t k = 0; k < n; ++k) {
    const int64_t task = (int64_t)vr[k] - CLOCK(0);
    if (task < 0 || task >= TASKS) return refuse(one, fmi3Error, "there is no such clock");
    intervals[k] = STEP * SUBSTEPS * (double)task_frames[task];
    qualifiers[k] = 1; /* unchanged: it is constant */
  }
  return fmi3OK;
}

/* What is not offered: no variables of other types, derivatives, partitions or configurations. */
#define NO_TYPE(type, ctype) \
  API fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, \
      ctype values[], size_t count) { \
    (void)vr, (void)values, (void)count; \
    return n ? refuse(c, fmi3Error, "all variables are Float64 or clocks") : fmi3OK; \
  } \
  API fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, \
      const ctype values[], size_t count) { \
    (void)vr, (void)values, (void)count; \
    return n ? refuse(c, fmi3Error, "all variables are Float64 or clocks") : fmi3OK; \
  }
#define NOT_OFFERED(name, arguments) \
  API fmi3Status name arguments { return refuse(c, fmi3Error, #name " is not offered"); }
typedef const char *text;
NO_TYPE(Float32, float)
NO_TYPE(Int8, int8_t)
NO_TYPE(UInt8, uint8_t)
NO_TYPE(Int16, int16_t)
NO_TYPE(UInt16, uint16_t)
NO_TYPE(Int32, int32_t)
NO_TYPE(UInt32, uint32_t)
NO_TYPE(Int64, int64_t)
NO_TYPE(UInt64, uint64_t)
NO_TYPE(Boolean, bool)
NO_TYPE(String, text)

API fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    size_t lengths[], const uint8_t *values[], size_t count) {
  (void)vr, (void)lengths, (void)values, (void)count;
  return n ? refuse(c, fmi3Error, "all variables are Float64 or clocks") : fmi3OK;
}

API fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const size_t lengths[], const uint8_t *const values[], size_t count) {
  (void)vr, (void)lengths, (void)values, (void)count;
  return n ? refuse(c, fmi3Error, "all variables are Float64 or clocks") : fmi3OK;
}

/* They read no other argument than the instance, which comes first in all of them. */
NOT_OFFERED(fmi3EnterConfigurationMode, (fmi3Instance c))
NOT_OFFERED(fmi3ExitConfigurationMode, (fmi3Instance c))
NOT_OFFERED(fmi3GetNumberOfVariableDependencies, (fmi3Instance c))
NOT_OFFERED(fmi3GetVariableDependencies, (fmi3Instance c))
NOT_OFFERED(fmi3GetDirectionalDerivative, (fmi3Instance c))
NOT_OFFERED(fmi3GetAdjointDerivative, (fmi3Instance c))
NOT_OFFERED(fmi3GetIntervalFraction, (fmi3Instance c))
NOT_OFFERED(fmi3GetShiftDecimal, (fmi3Instance c))
NOT_OFFERED(fmi3GetShiftFraction, (fmi3Instance c))
NOT_OFFERED(fmi3SetIntervalDecimal, (fmi3Instance c))
NOT_OFFERED(fmi3SetIntervalFraction, (fmi3Instance c))
NOT_OFFERED(fmi3SetShiftDecimal, (fmi3Instance c))
NOT_OFFERED(fmi3SetShiftFraction, (fmi3Instance c))
NOT_OFFERED(fmi3GetOutputDerivatives, (fmi3Instance c))
NOT_OFFERED(fmi3ActivateModelPartition, (fmi3Instance c))
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
