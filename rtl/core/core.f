// the two motor units and the parameter unit; needs rtl/fp/fp.f
rtds_row.v
rtds_motor.v
rtds_sequencer.v
rtds_param_unit.v
rtds_core.v
