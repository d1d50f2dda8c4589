// the two motor units, the parameter unit and the effect unit; needs rtl/fp/fp.f
-f ../effects/effects.f
rtds_row.v
rtds_friction.v
rtds_motor.v
rtds_sequencer.v
rtds_param_unit.v
rtds_core.v
