"""Cases whose runs are replays of a machine that differs from the nominal one in known quantities."""

from dataclasses import replace

import numpy as np
from axis_machine import NOISE

from rtds_host.contract import Case
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUT_INDEX


def altered(case: Case, **quantities: float) -> Case:
    """A case of an axis with its runs by a machine that has these quantities more."""
    model = nominal_model(case.robot)
    for name, value in quantities.items():
        model.add(name, value)
    rng, runs = np.random.default_rng(5), []
    for log in case.runs:
        out = replay_run(model, run_inputs(log, case.robot))
        seen = {
            channel: out[:, OUTPUT_INDEX[channel]] + noise * rng.standard_normal(len(log.t))
            for channel, noise in (("w_l", NOISE["w_rad_s"]), ("th_l", NOISE["th_rad"]))
        }
        runs.append(replace(log, columns={**log.columns, **seen}))
    return replace(case, runs=tuple(runs))
