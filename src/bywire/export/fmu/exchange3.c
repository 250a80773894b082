/* Functional Mock-up Interface 3.0, model exchange: the functions that a solver calls, with exchange.h. */
#include "exchange.h"

#define KIND_TEXT "model exchange"
#include "fmi3.h"

API fmi3Instance fmi3InstantiateModelExchange(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, logger log) {
  instance *one = instantiated(token, logging, environment, log);
  (void)name, (void)resources, (void)visible;
  if (one) one->has_events = true;
  return one;
}

API fmi3Instance fmi3InstantiateCoSimulation(const char *name, const char *token,
    const char *resources, bool visible, bool logging, bool event_mode, bool early_return,
    const fmi3ValueReference intermediate[], size_t n, void *environment, logger log,
    void *update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode;
  (void)early_return, (void)intermediate, (void)n, (void)update;
  return not_this(environment, log);
}

API fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  ((instance *)c)->now = IN_EVENT;
  return fmi3OK;
}

API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *again, bool *terminate,
    bool *nominal, bool *state, bool *has_next, double *next) {
  instance *one = c;
  if (one->now != IN_EVENT) return refuse(one, fmi3Error, "the FMU is not in event mode");
  *again = *terminate = *nominal = *has_next = false;
  *next = 0.0;
  *state = settle(&one->r);
  return fmi3OK;
}

API fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
  ((instance *)c)->now = RUNNING;
  return fmi3OK;
}

API fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, bool no_earlier_state, bool *is_event,
    bool *terminate) {
  (void)c, (void)no_earlier_state;
  *is_event = *terminate = false;
  return fmi3OK;
}

API fmi3Status fmi3SetTime(fmi3Instance c, double time) {
  ((instance *)c)->r.time = time;
  return fmi3OK;
}

API fmi3Status fmi3SetContinuousStates(fmi3Instance c, const double x[], size_t n) {
  return answer(c, take_states(&((instance *)c)->r, x, n));
}

API fmi3Status fmi3GetContinuousStates(fmi3Instance c, double x[], size_t n) {
  return answer(c, give_states(&((instance *)c)->r, x, n));
}

API fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, double rate[], size_t n) {
  instance *one = c;
  char said[MESSAGE];
  const fmi3Status status = answer(c, give_rates(&one->r, rate, n));
  if (status != fmi3OK || !unknown_rate(&one->r)) return status;
  snprintf(said, MESSAGE, "the derivative of %s is not a finite number", unknown_rate(&one->r));
  return refuse(c, fmi3Discard, said);
}

API fmi3Status fmi3GetEventIndicators(fmi3Instance c, double z[], size_t n) {
  return answer(c, give_indicators(&((instance *)c)->r, z, n));
}

API fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, double x[], size_t n) {
  return answer(c, give_nominals(x, n));
}

API fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
  (void)c;
  *n = INDICATORS;
  return fmi3OK;
}

API fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
  (void)c;
  *n = STATES;
  return fmi3OK;
}

/* Functions for steps and clocks. */
NOT_OFFERED(fmi3EnterStepMode, (fmi3Instance c))
NOT_OFFERED(fmi3DoStep, (fmi3Instance c))
NOT_OFFERED(fmi3SetClock, (fmi3Instance c))
NOT_OFFERED(fmi3GetClock, (fmi3Instance c))
NOT_OFFERED(fmi3GetIntervalDecimal, (fmi3Instance c))
