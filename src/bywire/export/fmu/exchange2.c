/* Functional Mock-up Interface 2.0, model exchange: the functions that a solver calls, with exchange.h. */
#include "exchange.h"

#define KIND 0
#define KIND_TEXT "model exchange"
#define AFTER_INITIALIZATION IN_EVENT
#include "fmi2.h"

typedef struct {
  int again, terminate, nominals, states, has_next;
  double next;
} event_info;

API fmi2Status fmi2EnterEventMode(fmi2Component c) {
  ((instance *)c)->now = IN_EVENT;
  return fmi2OK;
}

API fmi2Status fmi2NewDiscreteStates(fmi2Component c, event_info *info) {
  instance *one = c;
  if (one->now != IN_EVENT) return refuse(one, fmi2Error, "the FMU is not in event mode");
  memset(info, 0, sizeof *info);
  info->states = settle(&one->r);
  return fmi2OK;
}

API fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  ((instance *)c)->now = RUNNING;
  return fmi2OK;
}

API fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, int no_earlier_state, int *is_event,
    int *terminate) {
  (void)c, (void)no_earlier_state;
  *is_event = *terminate = 0;
  return fmi2OK;
}

API fmi2Status fmi2SetTime(fmi2Component c, double time) {
  ((instance *)c)->r.time = time;
  return fmi2OK;
}

API fmi2Status fmi2SetContinuousStates(fmi2Component c, const double x[], size_t n) {
  return answer(c, take_states(&((instance *)c)->r, x, n));
}

API fmi2Status fmi2GetContinuousStates(fmi2Component c, double x[], size_t n) {
  return answer(c, give_states(&((instance *)c)->r, x, n));
}

API fmi2Status fmi2GetDerivatives(fmi2Component c, double rate[], size_t n) {
  instance *one = c;
  char said[MESSAGE];
  const fmi2Status status = answer(c, give_rates(&one->r, rate, n));
  if (status != fmi2OK || !unknown_rate(&one->r)) return status;
  snprintf(said, MESSAGE, "the derivative of %s is not a finite number", unknown_rate(&one->r));
  return refuse(c, fmi2Discard, said);
}

API fmi2Status fmi2GetEventIndicators(fmi2Component c, double z[], size_t n) {
  return answer(c, give_indicators(&((instance *)c)->r, z, n));
}

API fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, double x[], size_t n) {
  return answer(c, give_nominals(x, n));
}
