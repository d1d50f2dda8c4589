/* The two motor units as a model of fmu_model.h: rtds_motor.c between inputs and outputs in double precision. */
#include <math.h>
#include <stdlib.h>

#include "fmu_model.h"
#include "rtds_motor.h"

struct fmu_model {
  double time, v[RTDS_SIDES], load[RTDS_SIDES], w[RTDS_SIDES], i[RTDS_SIDES];
  double motor[RTDS_SIDES][RTDS_PARAMETERS - 1], step_s;
  int32_t method;
  rtds_effects effects;
  rtds_pair pair;
};

const fmu_variable fmu_variables[] = FMU_VARIABLES;
const uint32_t fmu_variable_count = sizeof fmu_variables / sizeof *fmu_variables;
static const fmu_model START = FMU_START;

fmu_model *fmu_new(void) {
  fmu_model *m = (fmu_model *)malloc(sizeof *m);
  if (m != NULL) *m = START;
  return m;
}

void fmu_free(fmu_model *m) { free(m); }

double *fmu_time(fmu_model *m) { return &m->time; }

double fmu_step_s(const fmu_model *m) { return m->step_s; }

const char *fmu_initialise(fmu_model *m) {
  double parameters[RTDS_SIDES][RTDS_PARAMETERS];
  for (int k = 0; k < RTDS_SIDES; k++) {
    for (int j = 0; j < RTDS_PARAMETERS - 1; j++) parameters[k][j] = m->motor[k][j];
    parameters[k][RTDS_PARAMETERS - 1] = m->step_s;
  }
  rtds_init(&m->pair);
  switch (rtds_set_parameters(&m->pair, parameters[0], parameters[1], m->method)) {
    case RTDS_OK: break;
    case RTDS_BAD_ARGUMENT: return "method: 0 (backward Euler) and 1 (trapezoidal) are known";
    default: return "a motor's parameter, or a coefficient of them, is no positive number of single precision";
  }
  if (rtds_set_effects(&m->pair, &m->effects) != RTDS_OK)
    return "effects.delay, effects.stride: 0 to 4095 entries of one step or more are taken";
  return NULL;
}

const char *fmu_steps(fmu_model *m, uint64_t n) {
  float v[RTDS_SIDES], t[RTDS_SIDES], out[1][RTDS_COLUMNS];
  for (int k = 0; k < RTDS_SIDES; k++) {
    if (!(fabs(m->v[k]) <= 3.4e38 && fabs(m->load[k]) <= 3.4e38)) return "an input is not finite";
    v[k] = (float)m->v[k];
    t[k] = (float)m->load[k];
  }
  if (n > UINT32_MAX) return "more steps at once than 2^32 - 1";
  const int status = rtds_step(&m->pair, v, t, (uint32_t)n, (uint32_t)n, out);
  for (int k = 0; k < RTDS_SIDES; k++) {
    m->i[k] = out[0][2 * k];
    m->w[k] = out[0][2 * k + 1];
  }
  return status == RTDS_OK ? NULL : "the motors' state is no longer finite";
}
