"""torque_ripple: A (sin x + p sin 2x + q cos 2x), x = n th + phi."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put
from rtds_host.diagnosis.effects.exported import left_out, own, row


def _second(name: str, meaning: str) -> Parameter:
    """One of the two parts of the second harmonic, as a share of the amplitude."""
    return Parameter(
        name, "1", null=0, low=-1, high=1, prior_width=0.2, starts=(0.0,), optional=True, shape=True, meaning=meaning
    )


EFFECT = Effect(
    id="torque_ripple",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "amplitude_nm",
            "N·m",
            scale="torque",
            null=0,
            low=0,
            high=2,
            prior_width=0.0085,
            starts=(0.0085,),
            meaning="amplitude at the wheel",
        ),
        # Over a hundred turns a hundredth of a cycle more is a whole cycle: a derivative takes far less.
        Parameter(
            "cycles_per_rev",
            "1",
            null=0,
            # All that drives a wheel through a reduction turns faster than it; a tenth is room for an estimate.
            low=0.9,
            high=3000,
            prior_width=40,
            starts=(1.0,),
            difference=1e-5,
            shape=True,
            meaning="periods a turn of the wheel",
        ),
        Parameter(
            "phase_rad",
            "rad",
            null=0,
            low=-7,
            high=7,
            prior_width=2,
            starts=(0.0,),
            shape=True,
            meaning="phase at angle zero",
        ),
        _second("second_in_phase", "second harmonic's share of the amplitude, in phase"),
        _second("second_in_quadrature", "the same a quarter of its period ahead"),
    ),
    apply=put(
        ripple="amplitude_nm",
        ripple_cycles="cycles_per_rev",
        ripple_phase="phase_rad",
        ripple_in_phase="second_in_phase",
        ripple_in_quadrature="second_in_quadrature",
    ),
    equation="A (sin x + p sin 2x + q cos 2x), x = n th + phi",
    source="contract, section 3; cogging and gear mesh: Z. Q. Zhu, D. Howe, IEEE Trans. Energy Convers. 15(4), 2000",
    confused_with=("stribeck_friction",),
    shown_by="slow steady turning over whole turns",
    check="Turn the wheel in the air slowly at a constant voltage: the current waves alike in every turn.",
    advice="Feed the ripple forward by angle, or change the gear stage whose tooth count matches.",
    periodic=True,
    runs_in="rtl",
    compared_at={
        "amplitude_nm": 0.03,
        "cycles_per_rev": 4.37,
        "phase_rad": 0.7,
        "second_in_phase": 0.1,
        "second_in_quadrature": -0.15,
    },
    exports=row(
        own("actuator/dcmotor cogging, one element a harmonic", needs="MuJoCo 4.0 or later"),
        *[left_out("no torque by the angle of a joint")] * 3,
    ),
    resembles=(
        ("torque", "th"),
        ("torque", "wheel_angle"),
        ("torque", "motor_angle"),
    ),
    exports_dcmotor=own("actuator/dcmotor cogging, one element a harmonic"),
)
