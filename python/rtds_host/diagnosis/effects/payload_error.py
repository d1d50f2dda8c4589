"""payload_error: m = m_nominal + payload + mass_kg."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    # On an axis the same error is mass or inertia beyond the declared load (contract, section 7).
    axis = model.get("axis")
    slot = "mass" if axis == 0 else ("axis_inertia" if axis == 1 else "axis_mass")
    model.add(slot, values["mass_kg"])


EFFECT = Effect(
    id="payload_error",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter("mass_kg", "kg", null=0, low=-5, high=50, spread=0.5, starts=(0.3, -0.2, 1.0),
                  meaning="mass beyond what the run says"),
    ),
    apply=_apply,
    equation="m = m_nominal + payload + mass_kg",
    source="contract, sections 3 and 7",
    confused_with=("slope_error", "load_friction", "rotor_inertia_error"),
    shown_by="a slope in both headings, with and without payload",
    advice="Weigh the robot.",
    runs_in="robot",
)
