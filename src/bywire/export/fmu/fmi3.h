/* Functional Mock-up Interface 3.0: functions that co-simulation and model exchange share.
 *
 * The including file first includes the definition of a run. It specifies the interface type with
 * KIND_TEXT. The value references are those of the variables, then of time, then any others.
 */
#include <stdbool.h>
#include <stddef.h>

#if defined(_WIN32)
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

#define TIME VARIABLES

typedef void *fmi3Instance, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*logger)(void *, fmi3Status, const char *, const char *);
typedef enum { INSTANTIATED, INITIALIZING, IN_EVENT, RUNNING, FAILED } phase;

typedef struct {
  run r;
  int now; /* a phase */
  bool is_logging, has_events, may_return_early;
  void *environment;
  logger log;
} instance;

static fmi3Status refuse(fmi3Instance c, fmi3Status status, const char *text) {
  const instance *one = c;
  const char *category = status == fmi3Warning ? "logStatusWarning" : "logStatusError";
  if (one->log && (one->is_logging || status >= fmi3Error))
    one->log(one->environment, status, category, text);
  return status;
}

/* Return fmi3OK, or log an error message and return fmi3Error. */
static fmi3Status answer(fmi3Instance c, const char *wrong) {
  return wrong ? refuse(c, fmi3Error, wrong) : fmi3OK;
}

static int is_running(const instance *one) {
  return one->now == IN_EVENT || one->now == RUNNING;
}

API const char *fmi3GetVersion(void) { return "3.0"; }

API fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t n, const char *const names[]) {
  (void)n, (void)names;
  ((instance *)c)->is_logging = on;
  return fmi3OK;
}

/* Return an instance, or log a message and return NULL if the token belongs to another model. */
static fmi3Instance instantiated(const char *token, bool logging, void *environment, logger log) {
  instance *one = calloc(1, sizeof *one);
  if (!one) return NULL;
  one->is_logging = logging;
  one->environment = environment;
  one->log = log;
  if (!token || strcmp(token, TOKEN)) {
    refuse(one, fmi3Error, "the instantiation token does not match this model's description");
    free(one);
    return NULL;
  }
  reset(&one->r);
  return one;
}

/* Log that this FMU does not support an interface type. */
static inline fmi3Instance not_this(void *environment, logger log) {
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU supports only " KIND_TEXT);
  return NULL;
}

API fmi3Instance fmi3InstantiateScheduledExecution(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, logger log,
    void *update, void *lock, void *unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  (void)update, (void)lock, (void)unlock;
  return not_this(environment, log);
}

API void fmi3FreeInstance(fmi3Instance c) { free(c); }

API fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance,
    double start, bool has_stop, double stop) {
  instance *one = c;
  const char *wrong = timed(&one->r, start, has_stop, stop);
  (void)has_tolerance, (void)tolerance; /* the step is fixed */
  if (!wrong) one->now = INITIALIZING;
  return answer(one, wrong);
}

API fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  instance *one = c;
  if (!one->r.is_begun && !begin(&one->r)) {
    one->now = FAILED;
    return refuse(one, fmi3Error, "the model has no equilibrium with these parameters");
  }
  one->now = one->has_events ? IN_EVENT : RUNNING;
  return fmi3OK;
}

API fmi3Status fmi3Terminate(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

API fmi3Status fmi3Reset(fmi3Instance c) {
  instance *one = c;
  reset(&one->r);
  one->now = INSTANTIATED;
  return fmi3OK;
}

/* Return the number of values of a value reference; 0 if the reference is unknown. */
static int size_of(fmi3ValueReference vr) {
  return vr < VARIABLES ? sizes[vr] : vr == TIME;
}

API fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    double values[], size_t count) {
  instance *one = c;
  run tried = one->r, *r = &one->r;
  size_t at = 0;
  if (one->now == INITIALIZING && !r->is_begun && begin(&tried)) r = &tried; /* a preview */
  else refresh(r);
  for (size_t k = 0; k < n; ++k) {
    const int size = size_of(vr[k]);
    if (!size || at + (size_t)size > count)
      return refuse(one, fmi3Error, "unknown value reference, or too little space for its values");
    for (int j = 0; j < size; ++j)
      values[at++] = vr[k] == TIME ? seconds(r)
                                   : *place_of(r, vr[k] + (unsigned)j);
  }
  return fmi3OK;
}

API fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const double values[], size_t count) {
  instance *one = c;
  run before = one->r; /* set all values or none */
  char said[MESSAGE] = "unknown value reference, or too few values";
  size_t at = 0;
  for (size_t k = 0; k < n; ++k) {
    const int size = vr[k] == TIME ? 0 : size_of(vr[k]);
    if (!size || at + (size_t)size > count) {
      one->r = before;
      return refuse(one, fmi3Error, said);
    }
    for (int j = 0; j < size; ++j) {
      set_value(&one->r, vr[k] + (unsigned)j, values[at++], is_running(one), said);
      if (said[0]) {
        one->r = before;
        return refuse(one, fmi3Error, said);
      }
    }
  }
  return fmi3OK;
}

API fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  instance *one = c;
  return answer(c, put_aside(&one->r, one->now, state));
}

API fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  instance *one = c;
  return answer(c, taken_back(&one->r, &one->now, state));
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
  return answer(c, serialized(state, bytes, size));
}

API fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t bytes[], size_t size,
    fmi3FMUState *state) {
  return answer(c, deserialized(bytes, size, state));
}

API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

/* Not supported: variables of other types, derivatives, partitions and configurations. */
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
  API fmi3Status name arguments { return refuse(c, fmi3Error, #name " is not supported"); }
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

/* These functions read only the instance, which is always the first argument. */
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
