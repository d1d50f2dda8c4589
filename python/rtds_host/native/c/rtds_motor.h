/* The two motor units as a C library: bit for bit what the RTL and its Python model compute.

   Units are SI at the motor shaft. Pairs are [left, right]. C99 or C++11, no allocation, no globals: a pair of motors
   is one `rtds_pair`, which may be copied. The caller keeps it in one thread at a time.

       rtds_pair motors;
       rtds_init(&motors);
       rtds_set_parameters(&motors, parameters, parameters, RTDS_BACKWARD_EULER);
       rtds_step(&motors, volts, loads, 3200, 100, samples);

   Compile with -ffp-contract=off, in single precision as it stands (SSE, NEON, no x87, no -ffast-math). */
#ifndef RTDS_MOTOR_H
#define RTDS_MOTOR_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define RTDS_SIDES 2
#define RTDS_STATES 4      /* i (A), w (rad/s), then their low words */
#define RTDS_COLUMNS 4     /* of a sample: i_l, w_l, i_r, w_r */
#define RTDS_PARAMETERS 7  /* R, L, Km, Kb, J, B, step */
#define RTDS_CONSTANTS 15  /* of the effect unit, in the order of enum rtds_constant */
#define RTDS_TABLES 6      /* command, drop, torque, ripple, forward, backward */
#define RTDS_CELLS 256
#define RTDS_DELAY_ENTRIES 4096

enum rtds_method { RTDS_BACKWARD_EULER = 0, RTDS_TRAPEZOIDAL = 1 };

enum rtds_constant {
  RTDS_COMMAND_K, RTDS_DROP_K, RTDS_TORQUE_K, RTDS_RIPPLE_K, RTDS_FORWARD_K, RTDS_BACKWARD_K, RTDS_SAG, RTDS_DECLINE,
  RTDS_NOMINAL, RTDS_LIMIT, RTDS_HEAT_IN, RTDS_HEAT_OUT, RTDS_PHASE, RTDS_LOAD_DRIVING, RTDS_LOAD_DRIVEN
};

enum rtds_table {
  RTDS_COMMAND, RTDS_DROP, RTDS_TORQUE, RTDS_RIPPLE, RTDS_FORWARD, RTDS_BACKWARD
};

enum rtds_status {
  RTDS_OK = 0,
  RTDS_BAD_PARAMETER,   /* a parameter or a coefficient is no positive normal binary32 number; the old ones stay */
  RTDS_BAD_ARGUMENT,    /* no step, no method, a delay too long */
  RTDS_NOT_FINITE       /* the state holds a NaN or an infinity after the steps */
};

/* What the effect unit is loaded with (docs/effect-unit.md). A line of a table is {intercept, slope}. */
typedef struct {
  int32_t on;      /* 0: the effect unit rests, the motors are ideal */
  int32_t delay;   /* the command is late by so many entries, 0 to RTDS_DELAY_ENTRIES - 1 */
  int32_t stride;  /* of so many steps each, 1 or more */
  float constants[RTDS_SIDES][RTDS_CONSTANTS];
  float tables[RTDS_SIDES][RTDS_TABLES][RTDS_CELLS][2];
} rtds_effects;

typedef struct {
  float state[RTDS_SIDES][RTDS_STATES];
  uint32_t step_count;
  /* From here on: private. */
  float c[RTDS_SIDES][9], next[RTDS_SIDES][9];
  int32_t has_next;
  rtds_effects effects;
  float ahead[RTDS_SIDES][4], inner[RTDS_SIDES][6], held[RTDS_SIDES];
  float memory[RTDS_DELAY_ENTRIES][RTDS_SIDES];
  int32_t at, filled, phase, prepared;
} rtds_pair;

/* Two motors at rest, without parameters and effects. */
void rtds_init(rtds_pair *pair);

/* Parameters of each side: R, L, Km, Kb, J, B, step; the step is shared. They act from the step after next, as in the
   RTL: the first step still has the old ones, the very first of all rests. */
int rtds_set_parameters(rtds_pair *pair, const double left[RTDS_PARAMETERS], const double right[RTDS_PARAMETERS],
                        int method);

/* Load the effect unit. A unit that was off starts from its initial state. */
int rtds_set_effects(rtds_pair *pair, const rtds_effects *effects);

/* Motors and effect unit at rest; parameters and effects stay. */
void rtds_clear(rtds_pair *pair);

/* `n_steps` with the inputs held. volts at the terminals (V), loads at the shaft (N m, positive opposes positive
   rotation). A sample is written after every `every` steps and at the end: ceil(n_steps / every) rows. */
int rtds_step(rtds_pair *pair, const float volts[RTDS_SIDES], const float loads[RTDS_SIDES], uint32_t n_steps,
              uint32_t every, float (*samples)[RTDS_COLUMNS]);

/* 1 while current and speed of both motors are finite. */
int rtds_finite(const rtds_pair *pair);

#ifdef __cplusplus
}
#endif
#endif
