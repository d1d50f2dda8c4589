"""winding_heating: R = R0 (1 + rise), rise' = (rise_per_watt i^2 R - rise) / tau."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put
from rtds_host.diagnosis.effects.exported import left_out, own, row

EFFECT = Effect(
    id="winding_heating",
    subsystem="winding",
    sided=True,
    parameters=(
        Parameter(
            "rise_per_watt",
            "1/W",
            scale="per_watt",
            null=0,
            low=0,
            high=80,
            prior_width=1.7,
            starts=(0.8, 3.3),
            meaning="relative rise of R a watt, steady",
        ),
        Parameter(
            "time_constant_s",
            "s",
            scale="run",
            null=1.5,
            low=0.05,
            high=100,
            # That of a motor of 8 mm is 4.2 s (Faulhaber 0816 SR, data sheet), and larger ones are slower.
            floor=1.0,
            prior_width=3,
            starts=(0.75, 3.0),
            shape=True,
            meaning="thermal time constant",
        ),
    ),
    apply=put(heat_rise="rise_per_watt", heat_tau="time_constant_s"),
    equation="R = R0 (1 + rise), rise' = (rise_per_watt i^2 R - rise) / tau",
    source="contract, section 3; first-order thermal model: IEC 60034-11",
    confused_with=("resistance_error", "battery_decline"),
    shown_by="a long loaded run",
    check="Measure the winding's resistance cold and again right after a loaded run.",
    advice="Let the motor cool between runs, or lower its load; model R with temperature.",
    without_winding=False,
    runs_in="rtl",
    compared_at={"rise_per_watt": 0.2, "time_constant_s": 4.0},
    exports=row(
        own("actuator/dcmotor thermal"),
        left_out("a joint has no winding"),
        left_out("a joint has no winding"),
        left_out("a drive has no winding"),
    ),
    resembles=(
        ("voltage", "t"),
        ("voltage", "heat"),
        ("torque_constant", "heat"),
    ),
    exports_dcmotor=own("actuator/dcmotor thermal"),
)
