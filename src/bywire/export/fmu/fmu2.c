/* Functional Mock-up Interface 2.0, co-simulation: the functions of an importer, over stepping.h.
 *
 * A step does the ticks that are due at its beginning, with the inputs that were set, then the
 * substeps. What a client gets between steps is the state right before the ticks that are due
 * then: the left limit. Signals named sampled.* are those right after the ticks at the beginning
 * of the last step, as a bench records them.
 */
#include <stddef.h>

#include "stepping.h"

#if defined(_WIN32)
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

typedef void *fmi2Component, *fmi2FMUstate, *fmi2ComponentEnvironment;
typedef unsigned int fmi2ValueReference;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef void (*logger)(fmi2ComponentEnvironment, const char *, fmi2Status, const char *,
    const char *, ...);
typedef struct {
  logger log;
  void *(*allocate)(size_t, size_t);
  void (*release)(void *);
  void (*finished)(fmi2ComponentEnvironment, fmi2Status);
  fmi2ComponentEnvironment environment;
} callbacks;

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, FAILED } phase;

typedef struct {
  run r;
  phase now;
  int is_logging;
  callbacks calls;
  char name[128];
} instance;

typedef struct {
  char token[sizeof TOKEN];
  int32_t now;
  run r;
} snapshot;

/* Say what a function does not do, or did with a reservation, and return its status. */
static fmi2Status refuse(fmi2Component c, fmi2Status status, const char *text) {
  const instance *one = c;
  const char *category = status == fmi2Warning ? "logStatusWarning" : "logStatusError";
  char format[2 * MESSAGE];
  size_t to = 0;
  for (const char *from = text; *from && to < sizeof format - 2; ++from) {
    if (*from == '%') format[to++] = '%'; /* some clients show the format as it stands */
    format[to++] = *from;
  }
  format[to] = 0;
  if (one->calls.log && (one->is_logging || status >= fmi2Error))
    one->calls.log(one->calls.environment, one->name, status, category, format);
  return status;
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }

API fmi2Component fmi2Instantiate(const char *name, int type, const char *guid,
    const char *resources, const callbacks *calls, int visible, int logging) {
  instance *one = calloc(1, sizeof *one);
  (void)resources, (void)visible;
  if (!one) return NULL;
  if (calls) one->calls = *calls;
  one->is_logging = logging;
  snprintf(one->name, sizeof one->name, "%s", name ? name : "");
  if (type != 1) {
    refuse(one, fmi2Error, "only co-simulation is offered");
  } else if (!guid || strcmp(guid, TOKEN)) {
    refuse(one, fmi2Error, "the GUID is not that of this model's description");
  } else {
    reset(&one->r);
    return one;
  }
  free(one);
  return NULL;
}

API void fmi2FreeInstance(fmi2Component c) { free(c); }

API fmi2Status fmi2SetDebugLogging(fmi2Component c, int on, size_t n, const char *const names[]) {
  (void)n, (void)names;
  ((instance *)c)->is_logging = on;
  return fmi2OK;
}

API fmi2Status fmi2SetupExperiment(fmi2Component c, int has_tolerance, double tolerance,
    double start, int has_stop, double stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  if (start != 0.0)
    return refuse(c, fmi2Error, "the run starts at time 0 s: the settling of the bench first");
  return fmi2OK;
}

API fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  ((instance *)c)->now = INITIALIZING;
  return fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  instance *one = c;
  if (!one->r.is_begun && !begin(&one->r)) {
    one->now = FAILED;
    return refuse(one, fmi2Error, "there is no state at rest with these parameters");
  }
  one->now = STEPPING;
  return fmi2OK;
}

API fmi2Status fmi2Terminate(fmi2Component c) {
  (void)c;
  return fmi2OK;
}

API fmi2Status fmi2Reset(fmi2Component c) {
  instance *one = c;
  reset(&one->r);
  one->now = INSTANTIATED;
  return fmi2OK;
}

API fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    double values[]) {
  instance *one = c;
  if (one->now == INITIALIZING && !one->r.is_begun) { /* a look at the initial values */
    run tried = one->r;
    if (begin(&tried)) {
      for (size_t k = 0; k < n; ++k) {
        if (vr[k] >= VARIABLES) return refuse(one, fmi2Error, "there is no such variable");
        values[k] = *place_of(&tried, vr[k]);
      }
      return fmi2OK;
    }
  }
  refresh(&one->r);
  for (size_t k = 0; k < n; ++k) {
    if (vr[k] >= VARIABLES) return refuse(one, fmi2Error, "there is no such variable");
    values[k] = *place_of(&one->r, vr[k]);
  }
  return fmi2OK;
}

API fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const double values[]) {
  instance *one = c;
  run before = one->r; /* all of them, or none */
  char said[MESSAGE];
  for (size_t k = 0; k < n; ++k) {
    set_value(&one->r, vr[k], values[k], one->now == STEPPING, said);
    if (said[0]) {
      one->r = before;
      return refuse(one, fmi2Error, said);
    }
  }
  return fmi2OK;
}

API fmi2Status fmi2DoStep(fmi2Component c, double time, double step, int no_earlier_state) {
  instance *one = c;
  char said[MESSAGE];
  double before = unsettled(&one->r);
  int64_t frames;
  (void)no_earlier_state;
  if (one->now != STEPPING) return refuse(one, fmi2Error, "it is not initialized");
  frames = frames_of(&one->r, time, step, said);
  if (!frames) return refuse(one, fmi2Error, said);
  advance(&one->r, frames, !IS_PLANT);
  if (lost(&one->r)) {
    one->now = FAILED;
    snprintf(said, MESSAGE, "the run left the numbers: %s is not finite", lost(&one->r));
    return refuse(one, fmi2Error, said);
  }
  if (unsettled(&one->r) > before)
    return refuse(one, fmi2Warning, "contacts or frictions did not settle in some substeps");
  return fmi2OK;
}

API fmi2Status fmi2CancelStep(fmi2Component c) {
  return refuse(c, fmi2Error, "steps are done at once: there is none to cancel");
}

API fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  instance *one = c;
  snapshot *kept = *state ? *state : calloc(1, sizeof *kept);
  if (!kept) return refuse(one, fmi2Error, "there is no memory for the state");
  memcpy(kept->token, TOKEN, sizeof TOKEN);
  kept->now = one->now;
  kept->r = one->r;
  *state = kept;
  return fmi2OK;
}

API fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  instance *one = c;
  const snapshot *kept = state;
  if (!kept || memcmp(kept->token, TOKEN, sizeof TOKEN))
    return refuse(one, fmi2Error, "the state is not one of this model");
  one->now = (phase)kept->now;
  one->r = kept->r;
  return fmi2OK;
}

API fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  if (state) free(*state), *state = NULL;
  return fmi2OK;
}

API fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(snapshot);
  return fmi2OK;
}

API fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, char bytes[],
    size_t size) {
  if (size < sizeof(snapshot)) return refuse(c, fmi2Error, "there is no room for the state");
  memcpy(bytes, state, sizeof(snapshot));
  return fmi2OK;
}

API fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const char bytes[], size_t size,
    fmi2FMUstate *state) {
  snapshot *kept;
  if (size != sizeof *kept || memcmp(bytes, TOKEN, sizeof TOKEN))
    return refuse(c, fmi2Error, "the bytes are not a state of this model");
  kept = *state ? *state : malloc(sizeof *kept);
  if (!kept) return refuse(c, fmi2Error, "there is no memory for the state");
  memcpy(kept, bytes, sizeof *kept);
  *state = kept;
  return fmi2OK;
}

API fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
    size_t nu, const fmi2ValueReference known[], size_t nk, const double dk[], double du[]) {
  (void)unknown, (void)nu, (void)known, (void)nk, (void)dk, (void)du;
  return refuse(c, fmi2Error, "directional derivatives are not offered");
}

API fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t n, const int order[], const double values[]) {
  (void)vr, (void)n, (void)order, (void)values;
  return refuse(c, fmi2Error, "derivatives of inputs are not taken: they are held over a step");
}

API fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t n, const int order[], double values[]) {
  (void)vr, (void)n, (void)order, (void)values;
  return refuse(c, fmi2Error, "derivatives of outputs are not offered");
}

API fmi2Status fmi2GetStatus(fmi2Component c, int kind, fmi2Status *value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "steps are done at once: there is no status to ask for");
}

API fmi2Status fmi2GetRealStatus(fmi2Component c, int kind, double *value) {
  instance *one = c;
  if (kind != 2) return refuse(c, fmi2Discard, "only the last successful time can be asked for");
  *value = STEP * SUBSTEPS * (double)one->r.frame;
  return fmi2OK;
}

API fmi2Status fmi2GetIntegerStatus(fmi2Component c, int kind, int *value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "there is no such status");
}

API fmi2Status fmi2GetBooleanStatus(fmi2Component c, int kind, int *value) {
  instance *one = c;
  if (kind != 3) return refuse(c, fmi2Discard, "there is no such status");
  *value = one->now == FAILED;
  return fmi2OK;
}

API fmi2Status fmi2GetStringStatus(fmi2Component c, int kind, const char **value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "there is no such status");
}

#define NO_VARIABLES(type, ctype) \
  API fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, \
      ctype values[]) { \
    (void)vr, (void)values; \
    return n ? refuse(c, fmi2Error, "all variables are Real") : fmi2OK; \
  } \
  API fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, \
      const ctype values[]) { \
    (void)vr, (void)values; \
    return n ? refuse(c, fmi2Error, "all variables are Real") : fmi2OK; \
  }
typedef const char *text;
NO_VARIABLES(Integer, int)
NO_VARIABLES(Boolean, int)
NO_VARIABLES(String, text)
