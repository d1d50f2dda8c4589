/* FMI 3.0 for co-simulation around a model of fmu_model.h: life cycle, variables by their table, steps of fixed length.
   Functions, types and rules are those of the FMI 3.0 standard (fmi-standard.org). What needs a capability that
   modelDescription.xml does not claim answers fmi3Error. */
#include "fmu_model.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef void (*log_function)(void *environment, fmi3Status status, const char *category, const char *message);

enum phase { INSTANTIATED, INITIALISING, STEPPING, OVER };
/* A communication point may miss the grid of steps by this part of a step: rounding of times in seconds. */
#define GRID_TOLERANCE 1e-3

typedef struct {
  enum phase phase;
  void *environment;
  log_function log;
  double start_s;
  uint64_t done;
  fmu_model *model;
} instance_t;

static fmi3Status refuse(instance_t *f, const char *what) {
  if (f->log) f->log(f->environment, fmi3Error, "logStatusError", what);
  return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, bool on, size_t count, const char *const categories[]) {
  (void)instance, (void)on, (void)count, (void)categories;
  return fmi3OK;
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                                bool visible, bool logging, bool event_mode, bool early_return,
                                                const uint32_t required[], size_t count, void *environment,
                                                log_function log, void *intermediate) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return, (void)required;
  (void)count, (void)intermediate;
  instance_t *f = (instance_t *)calloc(1, sizeof *f);
  if (f == NULL) return NULL;
  f->environment = environment;
  f->log = log;
  if (token == NULL || strcmp(token, FMU_TOKEN) != 0) {
    refuse(f, "the instantiation token is that of another FMU");
  } else if ((f->model = fmu_new()) == NULL) {
    refuse(f, "no memory for the model");
  }
  if (f->model == NULL) {
    free(f);
    return NULL;
  }
  return f;
}

EXPORT void fmi3FreeInstance(fmi3Instance instance) {
  instance_t *f = (instance_t *)instance;
  if (f == NULL) return;
  fmu_free(f->model);
  free(f);
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, bool tolerance_defined, double tolerance,
                                              double start, bool stop_defined, double stop) {
  instance_t *f = (instance_t *)instance;
  (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
  if (f->phase != INSTANTIATED) return refuse(f, "initialisation begins after instantiation or reset alone");
  f->start_s = start;
  *fmu_time(f->model) = start;
  f->phase = INITIALISING;
  return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
  instance_t *f = (instance_t *)instance;
  if (f->phase != INITIALISING) return refuse(f, "the FMU is not in its initialisation");
  const char *why = fmu_initialise(f->model);
  if (why != NULL) return refuse(f, why);
  f->phase = STEPPING;
  return fmi3OK;
}

EXPORT fmi3Status fmi3Terminate(fmi3Instance instance) {
  ((instance_t *)instance)->phase = OVER;
  return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(fmi3Instance instance) {
  instance_t *f = (instance_t *)instance;
  fmu_model *fresh = fmu_new();
  if (fresh == NULL) return refuse(f, "no memory for the model");
  fmu_free(f->model);
  f->model = fresh;
  f->done = 0;
  f->phase = INSTANTIATED;
  return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, double now, double length, bool no_way_back, bool *events,
                             bool *terminate, bool *early, double *last) {
  instance_t *f = (instance_t *)instance;
  (void)no_way_back;
  *events = *terminate = *early = false;
  *last = now;
  if (f->phase != STEPPING) return refuse(f, "a step before the initialisation or after the end");
  const double h = fmu_step_s(f->model);
  const double from = (now - f->start_s) / h, to = (now + length - f->start_s) / h;
  const double end = floor(to + 0.5);
  if (fabs(from - (double)f->done) > GRID_TOLERANCE) return refuse(f, "the step does not begin where the last one ended");
  if (fabs(to - end) > GRID_TOLERANCE || end <= (double)f->done) {
    char text[160];
    snprintf(text, sizeof text, "a step of %.17g s is no whole number of inner steps of %.9g s", length, h);
    return refuse(f, text);
  }
  const char *why = fmu_steps(f->model, (uint64_t)end - f->done);
  f->done = (uint64_t)end;
  *fmu_time(f->model) = *last = now + length;
  return why == NULL ? fmi3OK : refuse(f, why);
}

/* Copies the values of these variables from or to the model. */
static fmi3Status transfer(instance_t *f, enum fmu_type type, const uint32_t references[], size_t count, void *values,
                           size_t n, bool set) {
  static const size_t SIZE[] = {sizeof(double), sizeof(float), sizeof(int32_t)};
  size_t at = 0;
  for (size_t k = 0; k < count; k++) {
    const uint32_t vr = references[k];
    if (vr >= fmu_variable_count || fmu_variables[vr].type != type) return refuse(f, "no such variable of this type");
    const fmu_variable *variable = &fmu_variables[vr];
    if (at + variable->count > n) return refuse(f, "fewer values than the variables hold");
    if (set && variable->kind == FMU_OUTPUT) return refuse(f, "an output or the time cannot be set");
    if (set && variable->kind == FMU_PARAMETER && f->phase >= STEPPING)
      return refuse(f, "a parameter can be set before the first step alone");
    char *inside = (char *)f->model + variable->offset, *outside = (char *)values + at * SIZE[type];
    memcpy(set ? inside : outside, set ? outside : inside, variable->count * SIZE[type]);
    at += variable->count;
  }
  return at == n ? fmi3OK : refuse(f, "more values than the variables hold");
}

#define ACCESS(NAME, TYPE, KIND)                                                                                     \
  EXPORT fmi3Status fmi3Get##NAME(fmi3Instance i, const uint32_t r[], size_t count, TYPE values[], size_t n) {      \
    return transfer((instance_t *)i, KIND, r, count, values, n, false);                                              \
  }                                                                                                                  \
  EXPORT fmi3Status fmi3Set##NAME(fmi3Instance i, const uint32_t r[], size_t count, const TYPE values[], size_t n) { \
    return transfer((instance_t *)i, KIND, r, count, (void *)values, n, true);                                       \
  }
ACCESS(Float64, double, FMU_FLOAT64)
ACCESS(Float32, float, FMU_FLOAT32)
ACCESS(Int32, int32_t, FMU_INT32)

/* Kinds of simulation and capabilities that the FMU does not have. The callers' further arguments are not looked at. */
#define NO_INSTANCE(NAME)           \
  EXPORT fmi3Instance NAME(void) { \
    return NULL;                    \
  }
#define UNSUPPORTED(NAME)                                                         \
  EXPORT fmi3Status NAME(fmi3Instance instance) {                                \
    return refuse((instance_t *)instance, #NAME ": the FMU has no such capability"); \
  }
NO_INSTANCE(fmi3InstantiateModelExchange)
NO_INSTANCE(fmi3InstantiateScheduledExecution)
UNSUPPORTED(fmi3EnterEventMode)
UNSUPPORTED(fmi3EnterStepMode)
UNSUPPORTED(fmi3EnterConfigurationMode)
UNSUPPORTED(fmi3ExitConfigurationMode)
UNSUPPORTED(fmi3GetInt8)
UNSUPPORTED(fmi3GetUInt8)
UNSUPPORTED(fmi3GetInt16)
UNSUPPORTED(fmi3GetUInt16)
UNSUPPORTED(fmi3GetUInt32)
UNSUPPORTED(fmi3GetInt64)
UNSUPPORTED(fmi3GetUInt64)
UNSUPPORTED(fmi3GetBoolean)
UNSUPPORTED(fmi3GetString)
UNSUPPORTED(fmi3GetBinary)
UNSUPPORTED(fmi3GetClock)
UNSUPPORTED(fmi3SetInt8)
UNSUPPORTED(fmi3SetUInt8)
UNSUPPORTED(fmi3SetInt16)
UNSUPPORTED(fmi3SetUInt16)
UNSUPPORTED(fmi3SetUInt32)
UNSUPPORTED(fmi3SetInt64)
UNSUPPORTED(fmi3SetUInt64)
UNSUPPORTED(fmi3SetBoolean)
UNSUPPORTED(fmi3SetString)
UNSUPPORTED(fmi3SetBinary)
UNSUPPORTED(fmi3SetClock)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies)
UNSUPPORTED(fmi3GetVariableDependencies)
UNSUPPORTED(fmi3GetFMUState)
UNSUPPORTED(fmi3SetFMUState)
UNSUPPORTED(fmi3FreeFMUState)
UNSUPPORTED(fmi3SerializedFMUStateSize)
UNSUPPORTED(fmi3SerializeFMUState)
UNSUPPORTED(fmi3DeserializeFMUState)
UNSUPPORTED(fmi3GetDirectionalDerivative)
UNSUPPORTED(fmi3GetAdjointDerivative)
UNSUPPORTED(fmi3GetIntervalDecimal)
UNSUPPORTED(fmi3GetIntervalFraction)
UNSUPPORTED(fmi3GetShiftDecimal)
UNSUPPORTED(fmi3GetShiftFraction)
UNSUPPORTED(fmi3SetIntervalDecimal)
UNSUPPORTED(fmi3SetIntervalFraction)
UNSUPPORTED(fmi3SetShiftDecimal)
UNSUPPORTED(fmi3SetShiftFraction)
UNSUPPORTED(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3UpdateDiscreteStates)
UNSUPPORTED(fmi3EnterContinuousTimeMode)
UNSUPPORTED(fmi3CompletedIntegratorStep)
UNSUPPORTED(fmi3SetTime)
UNSUPPORTED(fmi3SetContinuousStates)
UNSUPPORTED(fmi3GetContinuousStateDerivatives)
UNSUPPORTED(fmi3GetEventIndicators)
UNSUPPORTED(fmi3GetContinuousStates)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates)
UNSUPPORTED(fmi3GetNumberOfEventIndicators)
UNSUPPORTED(fmi3GetNumberOfContinuousStates)
UNSUPPORTED(fmi3GetOutputDerivatives)
UNSUPPORTED(fmi3ActivateModelPartition)
