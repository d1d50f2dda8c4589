"""What the tests of the links share."""

STEP_S = 1e-5
BURGER = {
    "resistance_ohm": 8.6,
    "inductance_h": 1e-3,
    "torque_constant_nm_per_a": 6.538e-3,
    "back_emf_constant_v_s_per_rad": 6.538e-3,
    "rotor_inertia_kg_m2": 1e-7,
    "viscous_friction_nm_s_per_rad": 4.372e-7,
    "step_s": STEP_S,
}
