"""Fast replay of a run from its commands: the nominal robot and every effect."""

from rtds_host.diagnosis.replay.layout import OUTPUTS
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run

__all__ = ["OUTPUTS", "Model", "nominal_model", "replay_run"]
