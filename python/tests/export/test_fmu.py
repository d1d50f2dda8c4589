"""FMUs: valid, run by fmpy, the motors with the model link's bytes, the robot as the exported Python module."""

import ctypes
import random
import subprocess
import zipfile
from pathlib import Path
from types import ModuleType

import fmpy
import numpy as np
import pytest
from export_cases import SERVO, SIZES, model_with
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from rtds_host.contract import builtin_robot
from rtds_host.correction.close import model_of
from rtds_host.diagnosis.forms.curves import points_of, put
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.export import compiled, fmu
from rtds_host.export.export import Source
from rtds_host.export.figures import figures_of
from rtds_host.export.python import parameters, write
from rtds_host.export.table import LEFT_OUT, OWN
from rtds_host.link import open_link
from rtds_host.native.library import FLAGS, compiler
from rtds_host.native.words import motor_units

ROBOT = builtin_robot("burger")
EFFECTS = (
    ("coulomb_friction", "left", {"torque_nm": 0.03}),
    ("driver_deadzone", "right", {"volts": 0.5}),
    ("supply_sag", "both", {"resistance_ohm": 0.3}),
    ("command_delay", "both", {"seconds": 0.002}),
    ("winding_heating", "left", {"rise_per_watt": 0.2, "time_constant_s": 0.05}),
    ("load_friction", "right", {"ratio": 0.2}),
)


class Slave:
    """An FMU unpacked and started with fmpy; variables by name."""

    def __init__(self, path, folder, start=None):
        self.description = fmpy.read_model_description(path)
        self.by_name = {variable.name: variable for variable in self.description.modelVariables}
        fmpy.extract(path, folder)
        self.fmu = FMU3Slave(
            guid=self.description.guid, unzipDirectory=str(folder), instanceName="it",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.fmu.instantiate()
        for name, values in (start or {}).items():
            self.set(name, values)
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def set(self, name, values):
        variable = self.by_name[name]
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], np.ravel(values).tolist())

    def get(self, *names):
        return np.array(self.fmu.getFloat64([self.by_name[name].valueReference for name in names]))

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope="module")
def units():
    return motor_units(model_with(*EFFECTS), ROBOT)


@pytest.fixture(scope="module")
def motors_fmu(units, tmp_path_factory):
    path = tmp_path_factory.mktemp("motors") / "motors.fmu"
    path.write_bytes(fmu.build(fmu.motors(units, "motors", "two motor units")))
    return path


@pytest.fixture(scope="module")
def robot_fmu(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "robot.fmu"
    path.write_bytes(fmu.build(fmu.robot(figures_of(model_with(*EFFECTS), ROBOT), "burger", "a robot")))
    return path


def exchanges(count, seed):
    rng = np.random.default_rng(seed)
    return [(rng.uniform(-12.0, 12.0, 2), rng.normal(0.0, 2e-4, 2), int(rng.integers(1, 400))) for _ in range(count)]


def fed(slave, work):
    """Speeds and currents after each exchange of `work`."""
    now, found = 0, []
    for v, load, steps in work:
        for name, value in (("v_l", v[0]), ("v_r", v[1]), ("load_l", load[0]), ("load_r", load[1])):
            slave.set(name, value)
        slave.fmu.doStep(now * 1e-5, steps * 1e-5)
        now += steps
        found.append(slave.get("w_l", "w_r", "i_l", "i_r").astype(np.float32))
    slave.close()
    return np.array(found)


def linked(units, work):
    with open_link("model") as link:
        link.set_effects(*units.effects)
        link.set_parameters(*units.parameters)
        found = []
        for v, load, steps in work:
            answer = link.exchange(v, load, steps * 1e-5)
            found.append([*answer.speeds[-1], *answer.currents[-1]])
    return np.array(found, np.float32)


def test_both_fmus_are_valid(motors_fmu, robot_fmu):
    for path in (motors_fmu, robot_fmu):
        assert validate_fmu(str(path)) == []


def test_the_motors_fmu_gives_the_bytes_of_the_model_link(motors_fmu, units, tmp_path):
    work = exchanges(300, 1)
    assert fed(Slave(motors_fmu, tmp_path), work).tobytes() == linked(units, work).tobytes()


def diagnosed(term, over, curve):
    """A diagnosis without an effect, with one form on both sides."""
    form = {"term": term, "side": "both", "over": over, "units": [], "curve": [[x, y, 0.01] for x, y in curve]}
    return {
        "schema": "rtds-diagnosis/3",
        "effects": [],
        "nominal_fit": {},
        "forms": [form | {"formula": None, "parameters": {}, "closes": 0.5}],
    }


def test_a_form_is_in_the_motors_tables_with_the_bytes_of_the_model_link(tmp_path):
    content = diagnosed("voltage", "v_cmd", [(x, 0.02 * x * abs(x)) for x in np.linspace(-10.0, 10.0, 14)])
    source = Source(content, model_of(content, ROBOT), ROBOT, "diagnosis.json")
    parts = compiled.write(source, "fmu-motors", tmp_path / "motors.fmu")
    assert [(part.effect, part.kind) for part in parts] == [("voltage over v_cmd", OWN)]
    work, formed = exchanges(50, 2), motor_units(source.model, ROBOT)
    found = fed(Slave(tmp_path / "motors.fmu", tmp_path / "unpacked"), work)
    assert found.tobytes() == linked(formed, work).tobytes()
    assert found.tobytes() != linked(motor_units(nominal_model(ROBOT), ROBOT), work).tobytes()


def test_motors_alone_leave_a_form_out_that_no_table_of_theirs_holds(tmp_path):
    content = diagnosed("force", "x", [(-1.0, 0.3), (1.0, -0.3)])
    source = Source(content, model_of(content, ROBOT), ROBOT, "diagnosis.json")
    parts = compiled.write(source, "c", tmp_path / "motors")
    assert [(part.effect, part.kind) for part in parts] == [("force over x", LEFT_OUT)]
    parts = compiled.robot_parts(source)
    assert [(part.effect, part.kind) for part in parts] == [("force over x", OWN)]


def test_parameters_and_tables_set_from_outside_make_another_robots_motors(motors_fmu, tmp_path):
    other = motor_units(
        model_with(
            ("bridge_drop", "both", {"volts": 0.4, "knee_a": 0.03}), ("resistance_error", "left", {"ratio": 1.3})
        ),
        ROBOT,
    )
    start = {
        "effects.on": int(other.words.on),
        "effects.delay": other.words.delay,
        "effects.stride": other.words.stride,
    }
    for k, side in enumerate(fmu.SIDES):
        start |= {f"{side}.{key}": other.values[k, n] for n, (key, _, _) in enumerate(fmu.MOTOR)}
        start |= {f"{side}.effects.{key}": other.words.constants[k, n] for n, key in enumerate(fmu.CONSTANTS)}
        start |= {f"{side}.effects.{key}": other.words.tables[k, n] for n, key in enumerate(fmu.TABLES)}
    work = exchanges(60, 2)
    assert fed(Slave(motors_fmu, tmp_path, start), work).tobytes() == linked(other, work).tobytes()


def test_fmpy_simulates_the_robot_and_its_outputs_move(robot_fmu):
    signals = np.array([(0.0, 4.0, 4.0), (1.0, 4.0, 4.0)], [("time", float), ("v_cmd_l", float), ("v_cmd_r", float)])
    result = fmpy.simulate_fmu(str(robot_fmu), stop_time=0.2, output_interval=0.01, input=signals)
    assert len(result) == 21 and result["x"][-1] > 0.005 and result["i_l"].max() > 0.05


NAMES = ("v_bus", "gyro_z", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "x", "y", "yaw")
# (effects, robot, start of a run): one of each equation of the module.
PLANAR = {
    "dry": (EFFECTS, ROBOT, {}),
    "slope": (
        (
            ("stribeck_friction", "left", {"torque_nm": 0.02, "extra_torque_nm": 0.02, "speed_rad_s": 2.0}),
            ("torque_ripple", "right", SIZES["torque_ripple"]),
            ("com_offset", "both", {"x_m": 0.02, "y_m": 0.01}),
            ("spin_scrub", "both", {"torque_nm": 0.05}),
            ("measurement_delay", "both", {"seconds": 0.0137}),
            ("speed_filter", "left", {"time_constant_s": 0.02, "delay_s": 0.003}),
        ),
        ROBOT,
        {"payload_kg": 0.3, "slope_rad": 0.1, "uphill_yaw_rad": 0.4},
    ),
    "history": ((), ROBOT, {}),
    "heat": ((), ROBOT, {}),
    "grease": ((), ROBOT, {}),
    "servo": (
        (
            ("pwm_curve", "both", {"curvature": 0.1, "fast_decay": 0.0}),
            ("battery_decline", "both", {"rate_v_per_s": 0.5}),
        ),
        SERVO,
        {},
    ),
}  # fmt: skip


# Forms of some of them: term, quantity, ends of the grid, values. Heats follow within half a second.
FORMS = {
    "slope": (
        ("force", "x", -0.2, 0.2, lambda x: -2.0 * x),
        ("yaw_torque", "yaw_rate", -3.0, 3.0, lambda x: -0.02 * np.sign(x) - 0.01 * x),
        ("torque_constant", "i", -0.4, 0.4, lambda x: -0.4 * np.abs(x)),
    ),
    "dry": (
        ("torque", "w", -20.0, 20.0, lambda x: -0.02 * np.sign(x) - 0.001 * x),
        ("voltage", "i", -0.4, 0.4, lambda x: -0.5 * np.tanh(x / 0.05)),
        ("torque", "motor_angle", 0.0, 2.0 * np.pi, np.sin),
    ),
    "history": (
        ("voltage", "command_history", -12.0, 12.0, lambda x: -0.5 * np.sign(x) - 0.03 * x),
        ("torque", "load", -0.4, 0.4, lambda x: -0.2 * np.abs(x) + 0.1 * x),
        ("force", "yaw", 0.0, 2.0 * np.pi, lambda x: 2.0 * np.cos(x - 0.5)),
    ),
    "heat": (
        ("voltage", "heat", 0.0, 0.02, lambda x: -25.0 * x),
        ("torque_constant", "heat", 0.0, 0.02, lambda x: -10.0 * x),
        ("torque", "heat", 0.0, 0.02, lambda x: -3.0 * x),
    ),
    "grease": (
        ("damping", "t", 0.0, 1.0, lambda x: 0.01 * np.exp(-3.0 * x)),
        ("damping", "heat", 0.0, 0.02, lambda x: -0.1 * x),
    ),
    "servo": (
        ("gyro_sensor", "t", 0.0, 1.0, lambda x: 0.05 * x),
        ("speed_sensor", "w", -20.0, 20.0, lambda x: 0.01 * x * np.abs(x)),
        ("torque", "t", 0.0, 1.0, lambda x: 0.1 * x),
    ),
}


@pytest.mark.parametrize("case", PLANAR)
def test_the_robot_fmu_goes_as_the_exported_python_module(case, tmp_path):
    effects, robot, start = PLANAR[case]
    model = model_with(*effects, robot=robot)
    for form in FORMS.get(case, ()):
        put(model, (0, 1), *form[:-1], form[-1](points_of(*form[1:-1])), 0.5 if form[1] == "heat" else 0.0)
    figures = figures_of(model, robot)
    (tmp_path / "it.fmu").write_bytes(fmu.build(fmu.robot(figures, "it", "")))
    slave = Slave(tmp_path / "it.fmu", tmp_path / "unpacked", start)
    exported = ModuleType("exported")
    exec(compile(write(figures, ""), "exported.py", "exec"), exported.__dict__)
    exported.STEP_S = 1e-5
    module = exported.Robot(**start)
    draw, now = random.Random(3), 0
    key = "w_cmd" if figures.loop else "v_cmd"
    for _ in range(12):
        left, right, steps = draw.uniform(-8.0, 8.0), draw.uniform(-8.0, 8.0), draw.randrange(100, 400)
        slave.set(f"{key}_l", left)
        slave.set(f"{key}_r", right)
        slave.fmu.doStep(now * 1e-5, steps * 1e-5)
        now += steps
        module.step(left, right, 1e-5)
        for _ in range(steps - 1):
            module.advance(1e-5)
        expected = module.sensors()
        # The same equations in the same order; libraries may differ in the last digits of a sine.
        np.testing.assert_allclose(slave.get(*NAMES), [expected[n] for n in NAMES], rtol=1e-9, atol=1e-12)
    slave.close()


def test_each_number_of_the_module_is_a_parameter_of_the_fmu():
    figures = figures_of(nominal_model(ROBOT), ROBOT)
    names = {v.name.rpartition(".")[2] for v in fmu.robot(figures, "it", "").variables if v.causality == "parameter"}
    assert parameters(figures).keys() - {"servo", "noise", "forms"} <= names


def test_an_fmu_declares_units_and_start_values(motors_fmu, robot_fmu):
    for path in (motors_fmu, robot_fmu):
        described = fmpy.read_model_description(path)
        assert described.coSimulation.fixedInternalStepSize == "1e-05"
        for v in described.modelVariables:
            assert (v.start is not None) == (v.causality in ("input", "parameter")), v.name
            if v.causality in ("input", "output"):
                assert v.unit in {unit.name for unit in described.unitDefinitions}


@pytest.mark.parametrize(("now", "length"), [(0.0, 1.5e-5), (0.0, 0.0), (1e-3, 1e-3)])
def test_a_step_off_the_grid_is_refused(motors_fmu, tmp_path, now, length):
    slave = Slave(motors_fmu, tmp_path)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.fmu.doStep(now, length)
    slave.close()


def test_what_cannot_be_set_is_refused_and_a_reset_brings_the_start_back(motors_fmu, units, tmp_path):
    slave = Slave(motors_fmu, tmp_path)
    work = exchanges(5, 4)
    slave.set("v_l", 5.0)
    slave.fmu.doStep(0.0, 1e-3)
    for name in ("left.resistance", "w_l", "left.effects.drop"):
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.set(name, np.ones(512 if name.endswith("drop") else 1))
    slave.fmu.reset()
    slave.set("left.resistance", -1.0)
    slave.fmu.enterInitializationMode(startTime=0.0)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.fmu.exitInitializationMode()
    slave.fmu.reset()
    slave.fmu.enterInitializationMode(startTime=0.0)
    slave.fmu.exitInitializationMode()
    assert fed(slave, work).tobytes() == linked(units, work).tobytes()


def test_the_sources_inside_build_the_binary_again_and_nothing_but_the_standard_is_visible(motors_fmu, tmp_path):
    with zipfile.ZipFile(motors_fmu) as packed:
        packed.extractall(tmp_path)
    folder = tmp_path / "sources"
    sources = [folder / name for name in fmu.MOTOR_SOURCES]
    command = [compiler(), *FLAGS, "-Werror", "-fvisibility=hidden", "-shared", "-o", tmp_path / "again.so", *sources]
    subprocess.run([*map(str, command), "-lm"], check=True, cwd=folder)
    place, ending = fmu.place_of_binary()
    assert (tmp_path / "again.so").stat().st_size > 10_000
    symbols = ctypes.CDLL(str(tmp_path / "again.so"))
    assert symbols.fmi3GetVersion and not hasattr(symbols, "rtds_step")
    assert (tmp_path / "binaries" / place / f"motors{ending}").is_file()


def test_the_same_robot_gives_the_same_fmu(units, motors_fmu):
    assert fmu.build(fmu.motors(units, "motors", "two motor units")) == Path(motors_fmu).read_bytes()
