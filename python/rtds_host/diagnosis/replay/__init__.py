"""Fast replay of a run from its commands: the nominal robot and every effect."""

from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run
from rtds_host.plant.schema import OUTPUTS

__all__ = ["OUTPUTS", "Model", "nominal_model", "replay_run"]
