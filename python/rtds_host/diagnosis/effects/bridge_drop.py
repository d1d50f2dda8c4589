"""bridge_drop: V = v_cmd - v sgn(i)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add

EFFECT = Effect(
    id="bridge_drop",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter("volts", "V", null=0, low=0, high=8, spread=0.3, starts=(0.1, 0.5),
                  meaning="brush and bridge drop"),
    ),
    apply=add(drop="volts"),
    equation="V = v_cmd - v sgn(i)",
    source="contract, section 3; brush drop: A. E. Fitzgerald et al., Electric Machinery, ch. 7",
    confused_with=("driver_deadzone", "coulomb_friction"),
    shown_by="braking and coasting with current logged",
    advice="Use a bridge with lower on-resistance, or add the drop to the command by the sign of the current.",
    runs_in="rtl",
)
