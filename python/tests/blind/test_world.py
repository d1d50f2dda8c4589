"""The MuJoCo world: another engine, the same robot, every effect in nature's form."""

import mujoco
import numpy as np
import pytest

from rtds_host.blind import cases, kernel, planar, scales, vocabulary, world
from rtds_host.blind.gap import channel_gaps, total
from rtds_host.contract import builtin_robot, read_case

ROBOT = builtin_robot("burger")
OF = scales.scale_of(ROBOT, 0.01, 16.0)
NOISE = {name: ROBOT.noise(name) for name in planar.CHANNELS}


def drive(machine, which, seconds=4.0, seed=7):
    """Channels of one world for steps of up to 12 V with 2 kg on a slope."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(0, seconds + 1e-9, 0.01), 4)
    volts, _ = planar.scenario("steps", t, rng, ROBOT)
    return t, planar.run_machine(machine, t, volts.copy(), np.zeros(5), 2.0, 0.1, 0.3, world=which)


def test_both_worlds_agree_on_the_nominal_robot_far_below_the_noise():
    t, plane = drive(planar.nominal_machine(ROBOT), "planar")
    _, other = drive(planar.nominal_machine(ROBOT), "mujoco")
    gaps = channel_gaps(t, other, plane, NOISE)
    assert max(gaps.values()) < 0.25


# Impacts, creep at standstill and the bend of a bristle differ between the worlds; that is what they are for.
LOOSE = {"backlash", "longitudinal_slip", "stribeck_friction"}


@pytest.mark.parametrize("name", sorted(vocabulary.EFFECTS))
def test_natures_form_of_an_effect_is_near_the_catalogues(name):
    machine = planar.nominal_machine(ROBOT)
    rng = np.random.default_rng(7)
    effect = vocabulary.draw_effect(rng, name)
    effect["side"] = "both" if not vocabulary.EFFECTS[name][1] else "left"
    planar.apply_effect(machine, effect)
    _, plain = drive(planar.nominal_machine(ROBOT), "planar")
    t, plane = drive(machine, "planar")
    _, other = drive(machine, "mujoco")
    assert all(np.isfinite(values).all() for values in other.values())
    size, apart = total(channel_gaps(t, plane, plain, NOISE)), total(channel_gaps(t, other, plane, NOISE))
    assert apart < max(0.3, (0.6 if name in LOOSE else 0.1) * size), (size, apart)


@pytest.mark.parametrize(
    "name", sorted(set(vocabulary.UNNAMED) - set(vocabulary.UNMODELLED) - set(vocabulary.PLANAR_ONLY))
)
def test_the_second_world_has_the_effects_outside_of_the_catalogue(name):
    machine = planar.nominal_machine(ROBOT)
    planar.apply_outside(machine, scales.draw_outside(np.random.default_rng(3), OF, name, "mujoco"))
    _, plain = drive(planar.nominal_machine(ROBOT), "mujoco", seconds=6.0)
    t, out = drive(machine, "mujoco", seconds=6.0)
    assert all(np.isfinite(values).all() for values in out.values())
    assert total(channel_gaps(t, out, plain, NOISE)) > 0.02


def test_motors_are_dcmotors_with_their_own_states():
    machine = planar.nominal_machine(ROBOT)
    for effect in (
        {"id": "winding_heating", "parameters": {"rise_per_watt": 0.2, "time_constant_s": 10.0}},
        {"id": "coulomb_friction", "parameters": {"torque_nm": 0.03}},
        {"id": "torque_ripple", "parameters": {"amplitude_nm": 0.02, "cycles_per_rev": 3, "phase_rad": 0.4}},
    ):
        planar.apply_effect(machine, {**effect, "side": "both"})
    model = mujoco.MjModel.from_xml_string(world.model_xml(machine.side, machine.world))
    assert set(model.actuator_dyntype) <= {int(mujoco.mjtDyn.mjDYN_DCMOTOR), int(mujoco.mjtDyn.mjDYN_NONE)}
    assert model.na == 2 * (2 + 1)  # current and temperature, and a bristle, each side


def test_a_run_that_became_unstable_is_none(tmp_path, monkeypatch):
    """MuJoCo goes on from its first state then, with speeds of thousands of rad/s in between."""
    monkeypatch.chdir(tmp_path)  # where it writes its warnings
    machine = planar.nominal_machine(ROBOT)
    play, spring = {"angle_rad": 0.05}, {"stiffness_nm_per_rad": 5000.0, "damping_nm_s_per_rad": 0.01}
    for name, parameters in (("backlash", play), ("gear_compliance", spring)):
        planar.apply_effect(machine, {"id": name, "parameters": parameters, "side": "both"})
    with pytest.raises(kernel.Diverged, match="unstable"):
        drive(machine, "mujoco", seconds=1.0)


def test_a_case_of_the_second_world_is_readable_and_repeatable(tmp_path):
    for name in ("a", "b"):
        spec = cases.draw_spec(np.random.default_rng(9), "pair", "mujoco")
        spec["runs"] = [dict(run, duration=4.0) for run in spec["runs"][:2]]
        truth = cases.make_case(5, spec, tmp_path / name)
    assert truth["world"] == "mujoco" and len(truth["effects"]) == 2
    assert len(read_case(tmp_path / "a").runs) == 2
    for path in sorted((tmp_path / "a").rglob("log.*")):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()
