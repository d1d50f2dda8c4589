"""payload_error: m = m_nominal + payload + mass_kg."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import no_current, one_slope, rotor_counts, straight_without_place, torque_drives
from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import of_body
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    if model.get("axis") == 0:
        model.add("mass", values["mass_kg"])
    else:  # a share of the declared load, of which something has to be left
        model.scale("axis_inertia" if model.get("axis") == 1 else "axis_mass", 1.0 + values["mass_kg"])


EFFECT = Effect(
    id="payload_error",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter(
            "mass_kg",
            "kg",
            scale="mass",
            null=0,
            low=-0.95,
            high=5,
            reach="movable",
            prior_width=0.5,
            starts=(0.3, -0.2, 1.0),
            meaning="mass (of an axis: load) beyond what is declared",
            declared={
                "inertia": ("inertia_kg_m2", "kg·m²"),
                "pendulum": ("mass_kg", "kg"),
                "linear": ("mass_kg", "kg"),
            },
        ),
    ),
    apply=_apply,
    equation="m = m_nominal + payload + mass_kg",
    source="contract, sections 3 and 7",
    confused_with=("slope_error", "load_friction", "rotor_inertia_error"),
    shown_by="a slope in both headings, with and without payload",
    check="Weigh the robot (of an axis: its load) as it was driven.",
    advice="Set the measured mass in robot.toml, or the payload in run.json.",
    runs_in="robot",
    form=0.02,
    compared_at={"mass_kg": 1.0},
    same_as={"rotor_inertia_error": rotor_counts},
    same_with_friction={"driver_gain": torque_drives, "speed_gain": torque_drives},
    nearly_as={
        "resistance_error": no_current,
        "torque_constant_error": no_current,
        "slope_error": one_slope,
        "wheel_radius_error": straight_without_place,
    },
    exports=of_body(),
)
