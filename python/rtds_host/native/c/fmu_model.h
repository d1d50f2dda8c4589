/* What rtds_fmi3.c needs of a model. `fmu_values.h` is written for each FMU: FMU_TOKEN, FMU_START (the start values)
   and FMU_VARIABLES (the table of variables, in the order of their value references). */
#ifndef FMU_MODEL_H
#define FMU_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "fmu_values.h"

enum fmu_type { FMU_FLOAT64, FMU_FLOAT32, FMU_INT32 };
enum fmu_kind { FMU_OUTPUT, FMU_INPUT, FMU_PARAMETER };

typedef struct {
  size_t offset; /* in the model */
  size_t count;  /* values: 1, or all of an array */
  enum fmu_type type;
  enum fmu_kind kind;
} fmu_variable;

typedef struct fmu_model fmu_model;
extern const fmu_variable fmu_variables[];
extern const uint32_t fmu_variable_count;

fmu_model *fmu_new(void); /* with start values; NULL without memory */
void fmu_free(fmu_model *model);
double *fmu_time(fmu_model *model);
double fmu_step_s(const fmu_model *model);
const char *fmu_initialise(fmu_model *model);          /* NULL, or why the parameters cannot be */
const char *fmu_steps(fmu_model *model, uint64_t n);   /* n inner steps; NULL, or what went wrong */

#endif
