"""Localisation by components: a perfect robot scores 1, an effect shows in its block and its subsystem."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import changed, make_case, without

from rtds_host.blind import planar
from rtds_host.contract import Case, builtin_robot
from rtds_host.diagnosis.effects import SUBSYSTEMS
from rtds_host.diagnosis.localise import BLOCKS, blocks, localise
from rtds_host.diagnosis.localise.shares import Sums
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.plant.schema import OUTPUTS


def located(case):
    return localise(case, nominal_model(case.robot))


def scores(localisation):
    return {b.name: b.score for b in localisation.blocks}


@pytest.fixture(scope="module")
def perfect():
    case = make_case(seconds=12.0)
    return case, located(case)


def test_a_perfect_robot_scores_the_noise_in_every_block(perfect):
    _, result = perfect
    assert set(scores(result)) == set(BLOCKS)
    assert all(0.85 < s < 1.15 for s in scores(result).values()), scores(result)
    assert result.shares() == []


def test_nuisances_within_their_prior_are_no_place_of_a_gap():
    def scatter(m):
        m.scale("resistance", 1.012, (0,))
        m.scale("rotor_inertia", 0.99, (1,))
        m.scale("torque_constant", 1.008, (0,))
        m.scale("back_emf", 1.008, (0,))

    assert located(make_case(scatter)).shares() == []


CAUSES = [
    ("driver", lambda m: m.add("source_resistance", 1.0), "bus"),
    ("driver", lambda m: m.put("deadzone", 0.4), "current_l"),
    ("driver", lambda m: m.put("limit", 5.0, (1,)), "current_r"),
    ("winding", lambda m: m.scale("resistance", 1.2, (0,)), "current_l"),
    ("drivetrain", lambda m: m.add("coulomb", 0.03, (1,)), "torque_r"),
    ("drivetrain", lambda m: m.add("viscous_wheel", 0.01), "torque_l"),
    ("drivetrain", lambda m: m.scale("rotor_inertia", 1.2), "torque_l"),
    ("wheel_ground", lambda m: m.scale("radius", 1.05, (0,)), "turn"),
    ("wheel_ground", lambda m: m.add("slip", 0.2), "way"),
    ("wheel_ground", lambda m: m.add("scrub", 0.05), "torque_l"),
    ("chassis", lambda m: m.scale("track", 1.05), "way"),
    ("chassis", lambda m: m.add("slope_extra", 0.05), "torque_r"),
    ("chassis", lambda m: m.add("mass", 1.5), "torque_l"),
    ("sensing", lambda m: m.put("speed_tau", 0.03, (0,)), "speed_twice_l"),
    ("sensing", lambda m: m.add("gyro_bias", 0.02), "turn"),
    ("sensing", lambda m: m.scale("current_gain", 1.1, (1,)), "torque_r"),
    ("timing", lambda m: m.put("command_delay", 0.025), "current_l"),
    ("timing", lambda m: m.put("measurement_delay", 0.012), "torque_l"),
]


@pytest.mark.parametrize(("subsystem", "change", "block"), CAUSES, ids=lambda v: v if isinstance(v, str) else "")
def test_an_effect_shows_in_its_block_and_its_subsystem(subsystem, change, block):
    result = located(make_case(change))
    assert scores(result)[block] > 1.3
    assert result.shares()[0]["subsystem"] == subsystem, (result.shares(), result.signatures)


def test_shares_sum_to_one_and_come_largest_first():
    shares = located(make_case(lambda m: (m.add("coulomb", 0.02), m.scale("track", 1.04)))).shares()
    values = [s["share"] for s in shares]
    assert abs(sum(values) - 1.0) < 1e-9 and values == sorted(values, reverse=True)
    assert {s["subsystem"] for s in shares} <= set(SUBSYSTEMS)


def test_the_model_with_the_effect_brings_the_blocks_back_to_noise():
    case = make_case(lambda m: m.add("coulomb", 0.03))
    model = nominal_model(case.robot)
    assert scores(localise(case, model))["torque_l"] > 5
    model.add("coulomb", 0.03)
    assert scores(localise(case, model))["torque_l"] < 1.6


def test_what_a_block_does_not_know_of_a_model_is_no_residual():
    """The reading of a filtered speed disagrees with the angle; a model that has the filter says by how much."""
    case = make_case(lambda m: m.put("speed_tau", 0.05))
    model = nominal_model(case.robot)
    model.put("speed_tau", 0.05)
    assert scores(localise(case, model))["speed_twice_l"] > 3
    assert max(scores(localise(case, model, held=True)).values()) < 1.3


def wobbly(_, columns):
    for c in ("w_l", "w_r"):
        columns[c] *= 1.0 + 0.1 * np.sin(columns[c.replace("w", "th")])


def bent(_, columns):
    for c in ("i_l", "i_r"):
        columns[c] *= 1.0 + (columns[c] / 0.5) ** 2


def saturated(_, columns):
    """A reading that falls again as the current grows: no power of what is read says what was there."""
    for c in ("i_l", "i_r"):
        columns[c] /= 1.0 + (columns[c] / 0.3) ** 2


@pytest.mark.parametrize(
    "fault",
    [wobbly, bent, saturated],
    ids=["a speed that wobbles with the angle", "a current that bends", "a current sensor that saturates"],
)
def test_a_sensor_without_a_name_for_its_fault_is_told_from_the_machine(fault):
    assert located(changed(make_case(), fault)).shares()[0]["subsystem"] == "sensing"


@pytest.mark.parametrize(
    "loose,subsystem", [(False, "wheel_ground"), (True, "drivetrain")], ids=["rigid gears", "free play"]
)
def test_a_turn_that_the_wheels_do_not_show_is_the_grounds_unless_gears_are_known_to_be_loose(loose, subsystem):
    """A twitch too short for the pose to see: either a tyre lets go for a moment, or a wheel shakes behind its gear."""

    def twitch(t, columns):
        columns["gyro_z"] = columns["gyro_z"] + 0.05 * np.sign(np.sin(40.0 * t)) * (
            np.abs(columns["w_l"] - columns["w_r"]) > 2.0
        )

    case = changed(make_case(), twitch)
    model = nominal_model(case.robot)
    if loose:
        model.put("backlash", 0.001)
    assert localise(case, model, held=True).shares()[0]["subsystem"] == subsystem


def test_a_delay_is_told_to_the_nearest_of_its_grid():
    result = located(make_case(lambda m: m.put("command_delay", 0.03)))
    assert result.lag_s == 0.03


def test_a_regime_shows_where_a_block_fails():
    torque = next(b for b in located(make_case(lambda m: m.put("limit", 4.0))).blocks if b.name == "current_l")
    assert torque.regimes["fast"] > 2 * torque.regimes["slow"]


def test_faults_that_no_signature_knows_stay_with_their_block():
    rng = np.random.default_rng(5)

    def dropouts(_, columns):
        for start in rng.integers(100, 700, 6):
            columns["w_l"][start : start + 25] = columns["w_l"][start]

    assert located(changed(make_case(), dropouts)).shares()[0]["subsystem"] == "sensing"


def test_what_missing_channels_cost_is_said_and_the_rest_still_works():
    case = without(make_case(lambda m: m.add("coulomb", 0.05)), "i_l", "i_r", "x", "y", "yaw")
    result = located(case)
    assert any("without current" in text for text in result.undetermined)
    assert any("x and y" in text for text in result.undetermined)
    assert "current_l" not in scores(result) and scores(result)["torque_l"] > 3


@pytest.mark.parametrize(
    "gone",
    [
        ("w_l", "w_r"),
        ("th_l", "th_r"),
        ("gyro_z",),
        ("v_bus", "i_l", "i_r"),
        ("w_l", "w_r", "i_l", "i_r", "v_bus", "gyro_z"),
        ("x", "y", "yaw", "gyro_z"),
    ],
)
def test_a_perfect_robot_without_some_channels_has_no_gap_anywhere(perfect, gone):
    result = located(without(perfect[0], *gone))
    assert result.shares() == [], (result.shares(), scores(result))


def test_the_same_case_gives_the_same_figures(perfect):
    case, first = perfect
    assert located(case) == first


def test_a_replay_that_runs_away_leaves_the_blocks_as_they_are(monkeypatch):
    case = make_case(lambda m: m.add("coulomb", 0.03))
    model = nominal_model(case.robot)
    plain = scores(localise(case, model))
    monkeypatch.setattr(blocks, "replay_run", lambda _, inputs: np.full((len(inputs[0]), len(OUTPUTS)), np.nan))
    assert scores(localise(case, model, held=True)) == plain


# Laws of another world that no signature has the form of: their place follows from the blocks alone.
UNMODELLED = {
    "commands in coarse steps": ("driver", {"id": "command_quantised", "side": "both", "parameters": {"quantum": 1.5}}),
    "a supply that gives way": (
        "driver",
        {"id": "supply_choked", "side": "both", "parameters": {"choke_ohm": 4.0, "choke_amps": 0.2, "choke_tau": 0.1}},
    ),
    "a drag that falls again with the speed": (
        "drivetrain",
        {"id": "eddy_drag", "side": "both", "parameters": {"eddy": 0.06, "eddy_speed": 1.5}},
    ),
    "gusts": ("chassis", {"id": "gusts", "side": "both", "parameters": {"gust": 1.5, "gust_tau": 0.4}}),
    "a load that sloshes": (
        "chassis",
        {"id": "sloshing", "side": "both", "parameters": {"slosh": 0.6, "slosh_rate": 12.0, "slosh_ratio": 0.05}},
    ),
    "a speed that reads zero when small": (
        "sensing",
        {"id": "speed_floor", "side": "both", "parameters": {"speed_floor": 1.0}},
    ),
}


def driven(machine, commanded=None):
    """Three flat runs of a machine of another world than the replay's, with the white noise that the robot's sensors
    declare; `commanded(t, columns)` puts other commands into a run."""

    def of_that_machine(t, columns):
        rng = np.random.default_rng(3)
        if commanded is not None:
            commanded(t, columns)
        commands = np.column_stack([columns["v_cmd_l"], columns["v_cmd_r"]])
        out = planar.run_machine(machine, t, commands, np.zeros(5), 0.0, 0.0, 0.0)
        for channel, values in planar.apply_sensors(out, machine, t).items():
            if channel in columns:
                columns[channel] = values + builtin_robot("burger").noise(channel) * rng.standard_normal(len(t))

    flat = make_case(seconds=12.0)
    flat = Case(
        flat.name,
        flat.robot,
        tuple(replace(run, meta=replace(run.meta, slope_rad=0.0, payload_kg=0.0)) for run in flat.runs),
    )
    return changed(flat, of_that_machine)


@pytest.mark.parametrize(("subsystem", "cause"), UNMODELLED.values(), ids=UNMODELLED)
def test_what_the_catalogue_has_no_name_for_is_placed_in_its_subsystem(subsystem, cause):
    machine = planar.nominal_machine(builtin_robot("burger"))
    planar.apply_outside(machine, cause)
    result = located(driven(machine))
    assert result.shares()[0]["subsystem"] == subsystem, (result.shares(), result.signatures)


# ---- effects that stand in -----------------------------------------------------------------------------------------

INERTIA = ("rotor_inertia_error", "both")


@pytest.mark.parametrize("unlike", [0.0, 0.3], ids=["straight", "sides apart"])
def test_a_cause_is_its_own_where_effects_and_tolerances_do_not_make_it(unlike):
    """On a robot that drives straight the other side's command does what a gain does."""
    rng = np.random.default_rng(4)
    left = rng.standard_normal(500)
    columns = np.column_stack([left, left + unlike * rng.standard_normal(500)])
    sums = SimpleNamespace(_total=(columns.T @ columns, np.zeros(2)))
    share = np.var(columns[:, 1] - left) / np.var(columns[:, 1])
    assert Sums.own(sums, 1, [0]) == pytest.approx(share, abs=0.01)
