/* Functional Mock-up Interface 2.0: functions that co-simulation and model exchange share.
 *
 * The including file first includes the definition of a run. It selects the interface type with KIND
 * (its number), KIND_TEXT and AFTER_INITIALIZATION.
 */
#include <stddef.h>

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

typedef enum { INSTANTIATED, INITIALIZING, IN_EVENT, RUNNING, FAILED } phase;

typedef struct {
  run r;
  int now; /* a phase */
  int is_logging;
  callbacks calls;
  char name[128];
} instance;

/* Log an error or a warning of a function, and return its status. */
static fmi2Status refuse(fmi2Component c, fmi2Status status, const char *text) {
  const instance *one = c;
  const char *category = status == fmi2Warning ? "logStatusWarning" : "logStatusError";
  char format[2 * MESSAGE];
  size_t to = 0;
  for (const char *from = text; *from && to < sizeof format - 2; ++from) {
    if (*from == '%') format[to++] = '%'; /* some clients print the unexpanded format */
    format[to++] = *from;
  }
  format[to] = 0;
  if (one->calls.log && (one->is_logging || status >= fmi2Error))
    one->calls.log(one->calls.environment, one->name, status, category, format);
  return status;
}

/* Return fmi2OK, or log an error message and return fmi2Error. */
static fmi2Status answer(fmi2Component c, const char *wrong) {
  return wrong ? refuse(c, fmi2Error, wrong) : fmi2OK;
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
  if (type != KIND) {
    refuse(one, fmi2Error, "this FMU supports only " KIND_TEXT);
  } else if (!guid || strcmp(guid, TOKEN)) {
    refuse(one, fmi2Error, "the GUID does not match this model's description");
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
  instance *one = c;
  (void)has_tolerance, (void)tolerance; /* the step is fixed */
  if (one->now != INSTANTIATED)
    return refuse(one, fmi2Error, "fmi2SetupExperiment must be called before initialization");
  return answer(one, timed(&one->r, start, has_stop, stop));
}

API fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  ((instance *)c)->now = INITIALIZING;
  return fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  instance *one = c;
  if (!one->r.is_begun && !begin(&one->r)) {
    one->now = FAILED;
    return refuse(one, fmi2Error, "the model has no equilibrium with these parameters");
  }
  one->now = AFTER_INITIALIZATION;
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
  if (one->now == INITIALIZING && !one->r.is_begun) { /* compute a preview of the initial values */
    run tried = one->r;
    if (begin(&tried)) {
      for (size_t k = 0; k < n; ++k) {
        if (vr[k] >= VARIABLES) return refuse(one, fmi2Error, "unknown value reference");
        values[k] = *place_of(&tried, vr[k]);
      }
      return fmi2OK;
    }
  }
  refresh(&one->r);
  for (size_t k = 0; k < n; ++k) {
    if (vr[k] >= VARIABLES) return refuse(one, fmi2Error, "unknown value reference");
    values[k] = *place_of(&one->r, vr[k]);
  }
  return fmi2OK;
}

API fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const double values[]) {
  instance *one = c;
  run before = one->r; /* set all values or none */
  char said[MESSAGE];
  for (size_t k = 0; k < n; ++k) {
    set_value(&one->r, vr[k], values[k], one->now >= IN_EVENT, said);
    if (said[0]) {
      one->r = before;
      return refuse(one, fmi2Error, said);
    }
  }
  return fmi2OK;
}

API fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  instance *one = c;
  return answer(c, put_aside(&one->r, one->now, state));
}

API fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  instance *one = c;
  return answer(c, taken_back(&one->r, &one->now, state));
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
  return answer(c, serialized(state, bytes, size));
}

API fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const char bytes[], size_t size,
    fmi2FMUstate *state) {
  return answer(c, deserialized(bytes, size, state));
}

API fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
    size_t nu, const fmi2ValueReference known[], size_t nk, const double dk[], double du[]) {
  (void)unknown, (void)nu, (void)known, (void)nk, (void)dk, (void)du;
  return refuse(c, fmi2Error, "directional derivatives are not supported");
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
