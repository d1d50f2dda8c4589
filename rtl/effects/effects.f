// the effect unit beside the motor units; needs rtl/fp/fp.f
effect_program.v
effect_index.v
effect_delay.v
effect_side.v
effect_engine.v
effect_unit.v
