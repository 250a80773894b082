/* Functional Mock-up Interface 2.0, co-simulation: the functions that an importer calls. They use
 * stepping.h.
 *
 * A step first runs the ticks that are due at its beginning, with the current inputs, and then the
 * substeps. Between steps, a client reads the state just before the ticks that are due at that time
 * (the left limit). Signals named sampled.* contain the values just after the ticks at the beginning
 * of the last step, as a bench records them.
 */
#include "stepping.h"

#define KIND 1
#define KIND_TEXT "co-simulation"
#define AFTER_INITIALIZATION RUNNING
#include "fmi2.h"

API fmi2Status fmi2DoStep(fmi2Component c, double time, double step, int no_earlier_state) {
  instance *one = c;
  char said[MESSAGE];
  double before = unsettled(&one->r);
  int64_t frames;
  (void)no_earlier_state;
  if (one->now != RUNNING) return refuse(one, fmi2Error, "the FMU is not initialized");
  frames = frames_of(&one->r, time, step, said);
  if (!frames) return refuse(one, fmi2Error, said);
  advance(&one->r, frames, !IS_PLANT);
  if (lost(&one->r)) {
    one->now = FAILED;
    snprintf(said, MESSAGE, "the run diverged: %s is not finite", lost(&one->r));
    return refuse(one, fmi2Error, said);
  }
  if (unsettled(&one->r) > before)
    return refuse(one, fmi2Warning, "contacts or friction did not settle in some substeps");
  return fmi2OK;
}

API fmi2Status fmi2CancelStep(fmi2Component c) {
  return refuse(c, fmi2Error, "steps are synchronous and cannot be canceled");
}

API fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t n, const int order[], const double values[]) {
  (void)vr, (void)n, (void)order, (void)values;
  return refuse(c, fmi2Error, "input derivatives are not supported, because inputs are constant over a step");
}

API fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t n, const int order[], double values[]) {
  (void)vr, (void)n, (void)order, (void)values;
  return refuse(c, fmi2Error, "output derivatives are not supported");
}

API fmi2Status fmi2GetStatus(fmi2Component c, int kind, fmi2Status *value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "steps are synchronous and have no pending status");
}

API fmi2Status fmi2GetRealStatus(fmi2Component c, int kind, double *value) {
  instance *one = c;
  if (kind != 2) return refuse(c, fmi2Discard, "the only available status is the last successful time");
  *value = seconds(&one->r);
  return fmi2OK;
}

API fmi2Status fmi2GetIntegerStatus(fmi2Component c, int kind, int *value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "unknown status");
}

API fmi2Status fmi2GetBooleanStatus(fmi2Component c, int kind, int *value) {
  instance *one = c;
  if (kind != 3) return refuse(c, fmi2Discard, "unknown status");
  *value = one->now == FAILED;
  return fmi2OK;
}

API fmi2Status fmi2GetStringStatus(fmi2Component c, int kind, const char **value) {
  (void)kind, (void)value;
  return refuse(c, fmi2Discard, "unknown status");
}
