// Steps the two motors of a robot by the C library, here against a flywheel on each shaft's end that brakes by its speed.
//
//   rtds export burger --to c --out motors
//   gcc -std=c99 -O2 -ffp-contract=off -c motors/rtds_motor.c -o rtds_motor.o
//   g++ -O2 -Imotors step_motors.cpp rtds_motor.o -o step_motors && ./step_motors > log.bin
#include <cstdio>

#include "motors.h"

int main() {
  static rtds_pair motors;
  rtds_init(&motors);
  if (rtds_set_parameters(&motors, RTDS_LEFT, RTDS_RIGHT, RTDS_BACKWARD_EULER) != RTDS_OK) return 1;
  if (rtds_set_effects(&motors, &RTDS_EFFECTS) != RTDS_OK) return 1;
  float samples[32][RTDS_COLUMNS] = {};
  for (int exchange = 0; exchange < 50; exchange++) {
    const float volts[2] = {0.2f * exchange, 6.0f - 0.25f * exchange};
    const float loads[2] = {1e-6f * samples[31][1], 1e-6f * samples[31][3]};  // your simulator's torques, N m
    if (rtds_step(&motors, volts, loads, 3200, 100, samples) != RTDS_OK) return 1;
    std::fwrite(samples, sizeof samples, 1, stdout);  // i_l, w_l, i_r, w_r each millisecond
  }
  return 0;
}
