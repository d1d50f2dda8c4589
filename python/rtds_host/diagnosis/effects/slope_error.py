"""slope_error: slope = slope_run + slope_rad."""

from rtds_host.diagnosis.conditions import one_slope
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, left_out, own, row

EFFECT = Effect(
    id="slope_error",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter(
            "slope_rad",
            "rad",
            null=0,
            low=-0.5,
            high=0.5,
            prior_width=0.02,
            starts=(0.01, -0.01),
            meaning="beyond what the run says, along its uphill direction",
        ),
    ),
    apply=add(slope_extra="slope_rad"),
    equation="slope = slope_run + slope_rad",
    source="contract, section 3",
    confused_with=("payload_error", "friction_asymmetry"),
    shown_by="both headings on the slope",
    check="Put a level on the floor along the way that was driven.",
    advice="Declare the measured slope in run.json.",
    runs_in="robot",
    axis=False,
    form=0.02,
    compared_at={"slope_rad": 0.03},
    nearly_as={"payload_error": one_slope},
    exports=row(
        own("option gravity; custom/numeric slope_extra_rad for a run on a slope"),
        left_out("URDF has no world"),
        as_number("comment: gravity belongs to the world, not to a model"),
        as_number("rtds.world"),
    ),
    resembles=(
        ("force", "x"),
        ("force", "y"),
    ),
)
