"""FMUs of FMI 3.0 for co-simulation: the two motor units, or the whole robot on a plane.

An FMU is written with its C sources and the binary of this machine. `native/c/rtds_fmi3.c` is the same in all;
`fmu_values.h` holds the start values and the table of variables, which modelDescription.xml declares in the same order.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from xml.sax.saxutils import quoteattr

import numpy as np

from rtds_host import __version__
from rtds_host.cleanup import temporary_folder
from rtds_host.errors import InputError
from rtds_host.export import python as planar
from rtds_host.export.figures import Figures
from rtds_host.motor.effect_program import CELLS, CONSTANTS, TABLES
from rtds_host.native.library import SOURCES, compile_shared
from rtds_host.native.words import STEP_S, MotorUnits, c_effects, float_text
from rtds_host.plant import forms
from rtds_host.plant.schema import SIDE

MOTOR_SOURCES = ("rtds_fmi3.c", "fmu_motors.c", "rtds_motor.c")
ROBOT_SOURCES = ("rtds_fmi3.c", "fmu_planar.c")
HEADERS = ("fmu_model.h", "rtds_motor.h")
LIBRARIES = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib")}
SIDES = ("left", "right")
# SI units by name: exponents of the base units, as the standard writes them.
UNITS = {
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "A": {"A": 1},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "rad/s": {"rad": 1, "s": -1},
    "rad": {"rad": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "N.m/A": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "V.s/rad": {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "1/W": {"kg": -1, "m": -2, "s": 3},
    "V/s": {"kg": 1, "m": 2, "s": -4, "A": -1},
    "V/rad": {"kg": 1, "m": 2, "s": -3, "A": -1, "rad": -1},
}
OUTPUTS = (
    ("v_bus", "V", "bus voltage"),
    ("gyro_z", "rad/s", "yaw rate reported"),
    ("i_l", "A", "current reported, left"),
    ("i_r", "A", "current reported, right"),
    ("w_l", "rad/s", "wheel speed reported, left"),
    ("w_r", "rad/s", "wheel speed reported, right"),
    ("th_l", "rad", "wheel angle reported, left"),
    ("th_r", "rad", "wheel angle reported, right"),
)
# The unit of a number of `standalone.PARAMETERS`, by the end of its name; the longest that fits counts.
SUFFIXES = {
    "_v_s_per_rad": "V.s/rad",
    "_nm_s_per_rad": "N.m.s/rad",
    "_nm_per_a": "N.m/A",
    "_per_w": "1/W",
    "_v_per_s": "V/s",
    "_v_per_rad": "V/rad",
    "_kg_m2": "kg.m2",
    "_rad_s": "rad/s",
    "_nm": "N.m",
    "_h": "H",
    "_ohm": "Ohm",
    "_kg": "kg",
    "_rad": "rad",
    "_m": "m",
    "_s": "s",
    "_v": "V",
    "_a": "A",
}
# What no number of the robot is in the FMU: noise; servo and forms, which are given apart.
NO_NUMBERS = ("noise", "servo", "forms")
# Of the torques by angle or speed, the numbers that the C model of the robot has.
TORQUES_IN_C = ("ripple_nm", "ripple_cycles", "ripple_phase_rad", "ripple_in_phase", "ripple_in_quadrature")


def _suffix(key: str) -> str:
    return max((suffix for suffix in SUFFIXES if key.endswith(suffix)), key=len, default="")


def _unit(key: str) -> str:
    return SUFFIXES.get(_suffix(key), "")


def _without_unit(key: str) -> str:
    return key.removesuffix(_suffix(key))


# A motor's constants: the plant's exported names without the unit, unit and meaning.
MOTOR = tuple(
    (_without_unit(SIDE[parameter].export), unit, meaning)
    for parameter, unit, meaning in (
        ("resistance", "Ohm", "winding resistance R"),
        ("inductance", "H", "winding inductance L"),
        ("torque_constant", "N.m/A", "torque constant Km"),
        ("back_emf", "V.s/rad", "back EMF constant Kb"),
        ("rotor_inertia", "kg.m2", "rotor inertia J, with what else turns rigidly with the shaft"),
        ("viscous", "N.m.s/rad", "viscous friction B"),
    )
)


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU: `member` is where it lies in the C model, `start` its value, None of an output."""

    name: str
    causality: str
    member: str
    start: float | int | np.ndarray | None = None
    unit: str = ""
    description: str = ""
    type: str = "Float64"
    shape: tuple[int, ...] = ()


@dataclass(frozen=True)
class Unit:
    """What an FMU is made of: `start` is C, designated initialisers of the model beyond its scalar variables."""

    name: str
    description: str
    variables: tuple[Variable, ...]
    sources: tuple[str, ...]
    start: str


def motors(units: MotorUnits, name: str, comment: str) -> Unit:
    """The two motor units: volts and loads in, speeds and currents out, all at the motor shaft."""
    found = [Variable("time", "independent", "time", unit="s", description="simulated time")]
    for quantity, unit, causality, text in (
        ("v", "V", "input", "voltage asked for"),
        ("load", "N.m", "input", "load torque, positive against positive rotation"),
        ("w", "rad/s", "output", "speed"),
        ("i", "A", "output", "current"),
    ):
        for k, side in enumerate(SIDES):
            start = 0.0 if causality == "input" else None
            found.append(
                Variable(f"{quantity}_{side[0]}", causality, f"{quantity}[{k}]", start, unit, f"{text}, {side}")
            )
    found.append(
        Variable(
            "step",
            "parameter",
            "step_s",
            float(units.values[0, 6]),
            "s",
            "inner step; communication steps are multiples",
        )
    )
    text = "0 backward Euler, 1 trapezoidal"
    found.append(Variable("method", "parameter", "method", 0, description=text, type="Int32"))
    for k, side in enumerate(SIDES):
        for n, (key, unit, text) in enumerate(MOTOR):
            found.append(
                Variable(f"{side}.{key}", "parameter", f"motor[{k}][{n}]", float(units.values[k, n]), unit, text)
            )
    words = units.words
    for key, value, text in (
        ("on", int(words.on), "1: the effect unit works"),
        ("delay", words.delay, "entries by which a command is late, at most 4095"),
        ("stride", words.stride, "steps of an entry"),
    ):
        found.append(Variable(f"effects.{key}", "parameter", f"effects.{key}", value, description=text, type="Int32"))
    for k, side in enumerate(SIDES):
        for n, key in enumerate(CONSTANTS):
            constant, text = float(words.constants[k, n]), "constant of the effect unit"
            member = f"effects.constants[{k}][{n}]"
            found.append(Variable(f"{side}.effects.{key}", "parameter", member, constant, "", text, "Float32"))
    for k, side in enumerate(SIDES):
        for n, key in enumerate(TABLES):
            text = "lines {intercept, slope} of the table's cells"
            member, shape = f"effects.tables[{k}][{n}]", (CELLS, 2)
            lines = words.tables[k, n]
            found.append(Variable(f"{side}.effects.{key}", "parameter", member, lines, "", text, "Float32", shape))
    return Unit(name, comment, tuple(found), MOTOR_SOURCES, f".effects = {c_effects(words)},")


def robot(figures: Figures, name: str, comment: str) -> Unit:
    """The whole robot on a plane: two commands in, what its sensors report and its pose out."""
    found = [Variable("time", "independent", "time", unit="s", description="simulated time")]
    command = ("w_cmd", "rad/s", "wheel speed asked for") if figures.loop else ("v_cmd", "V", "voltage asked for")
    for k, side in enumerate(SIDES):
        key, unit, text = command
        found.append(Variable(f"{key}_{side[0]}", "input", f"command[{k}]", 0.0, unit, f"{text}, {side}"))
    for n, (key, unit, text) in enumerate(OUTPUTS):
        found.append(Variable(key, "output", f"out[{n}]", None, unit, text))
    for key, unit in (("x", "m"), ("y", "m"), ("yaw", "rad")):
        found.append(Variable(key, "output", key, None, unit, "pose of the middle of the axle"))
    for key, value, unit, text in (
        ("step_s", STEP_S, "s", "inner step; communication steps are multiples"),
        ("payload_kg", 0.0, "kg", "payload over the middle of the axle"),
        ("slope_rad", 0.0, "rad", "slope of the plane"),
        ("uphill_yaw_rad", 0.0, "rad", "heading in which it climbs"),
    ):
        found.append(Variable(key, "parameter", key, value, unit, text))
    for n, key in enumerate(("x", "y", "yaw", "th_l", "th_r")):
        found.append(
            Variable(f"start.{key}", "parameter", f"start[{n}]", 0.0, "m" if n < 2 else "rad", "pose at the start")
        )
    without = {*NO_NUMBERS, *figures.sides[0].torques} - {*TORQUES_IN_C}
    numbers: dict[str, float | list[float]] = {"command_gain": [1.0, 1.0]}
    numbers |= {key: value for key, value in planar.parameters(figures).items() if key not in without}
    for key, numeral in numbers.items():
        if isinstance(numeral, list):
            for k, number in enumerate(numeral):
                found.append(Variable(f"{SIDES[k]}.{key}", "parameter", f"{key}[{k}]", float(number), _unit(key)))
        else:
            found.append(Variable(key, "parameter", key, float(numeral), _unit(key)))
    for k, rows in enumerate(planar.rows_of(figures) or ()):
        for n, row in enumerate(rows):
            if row[forms.TERM]:
                text = (
                    "a free curve: its term, what it runs over, ends of its grid, time constant of a heat, and values"
                )
                member, label = f"forms[{k}][{n}]", f"{SIDES[k]}.form_{n + 1}"
                found.append(Variable(label, "parameter", member, np.array(row), "", text, shape=(forms.WIDTH,)))
    loop = figures.loop
    found.append(
        Variable(
            "servo_on", "parameter", "servo_on", int(loop is not None), description="commands are speeds", type="Int32"
        )
    )
    for key in ("kp_v_s_per_rad", "ki_v_per_rad", "limit_v", "period_s"):
        value = float(getattr(loop, key)) if loop else 0.0
        found.append(Variable(f"servo.{key}", "parameter", f"servo_{key}", value, _unit(f"_{key}")))
    return Unit(name, comment, tuple(found), ROBOT_SOURCES, "")


def _start_text(variable: Variable) -> str:
    if isinstance(variable.start, np.ndarray):
        text = repr if variable.type == "Float64" else float_text
        return " ".join(text(float(value)) for value in variable.start.ravel())
    if variable.type == "Float32":
        return float_text(float(variable.start or 0.0))
    return repr(variable.start)


def token(unit: Unit) -> str:
    """The instantiation token: the same for the same variables, values and sources."""
    digest = hashlib.sha256(repr((__version__, unit.name, unit.start)).encode())
    for variable in unit.variables:
        text = "" if variable.start is None else _start_text(variable)
        digest.update(f"{variable.name} {variable.type} {text}\n".encode())
    for name in (*unit.sources, *HEADERS):
        digest.update((SOURCES / name).read_bytes())
    found = digest.hexdigest()
    return "{" + "-".join((found[:8], found[8:12], found[12:16], found[16:20], found[20:32])) + "}"


def values_header(unit: Unit) -> str:
    """The text of fmu_values.h."""
    types = {"Float64": "FMU_FLOAT64", "Float32": "FMU_FLOAT32", "Int32": "FMU_INT32"}
    kinds = {"independent": "FMU_OUTPUT", "output": "FMU_OUTPUT", "input": "FMU_INPUT", "parameter": "FMU_PARAMETER"}
    rows, starts = [], []
    for v in unit.variables:
        count = int(np.prod(v.shape, dtype=int))
        rows.append(f"  {{offsetof(struct fmu_model, {v.member}), {count}, {types[v.type]}, {kinds[v.causality]}}},")
        if v.start is not None and not v.member.startswith("effects."):
            start = repr(v.start)
            if isinstance(v.start, np.ndarray):
                start = "{" + ", ".join(map(repr, v.start.tolist())) + "}"
            starts.append(f".{v.member} = {start},")
    return "\n".join(
        [
            f"/* {unit.name}: written by rtds {__version__}; see fmu_model.h. */",
            f'#define FMU_TOKEN "{token(unit)}"',
            "#define FMU_START " + _continued("{" + "\n".join(starts) + "\n" + unit.start + "}"),
            "#define FMU_VARIABLES " + _continued("{\n" + "\n".join(rows) + "\n}"),
            "",
        ]
    )


def _continued(text: str) -> str:
    return text.replace("\n", " \\\n")


def description(unit: Unit) -> str:
    """The text of modelDescription.xml."""
    used = sorted({v.unit for v in unit.variables if v.unit})
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(unit.name)} instantiationToken="{token(unit)}"',
        f"  description={quoteattr(unit.description)}",
        f'  generationTool="rtds {__version__}" variableNamingConvention="structured">',
        f'  <CoSimulation modelIdentifier="{unit.name}" canHandleVariableCommunicationStepSize="true"'
        f' fixedInternalStepSize="{_step(unit)!r}"/>',
        "  <UnitDefinitions>",
    ]
    for name in used:
        base = " ".join(f'{key}="{power}"' for key, power in UNITS[name].items())
        lines.append(f'    <Unit name="{name}"><BaseUnit {base}/></Unit>')
    lines += ["  </UnitDefinitions>", '  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.001"/>']
    lines.append("  <ModelVariables>")
    for reference, v in enumerate(unit.variables):
        text = f'    <{v.type} name="{v.name}" valueReference="{reference}" causality="{v.causality}"'
        if v.causality == "parameter":
            text += ' variability="fixed" initial="exact"'
        elif v.causality == "output":
            text += ' variability="continuous" initial="calculated"'
        elif v.causality in ("independent", "input"):
            text += ' variability="continuous"'
        text += f" unit={quoteattr(v.unit)}" if v.unit else ""
        text += f" description={quoteattr(v.description)}" if v.description else ""
        text += "" if v.start is None else f' start="{_start_text(v)}"'
        inner = "".join(f'<Dimension start="{size}"/>' for size in v.shape)
        lines.append(f"{text}>{inner}</{v.type}>" if inner else f"{text}/>")
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    outputs = [k for k, v in enumerate(unit.variables) if v.causality == "output"]
    lines += [f'    <Output valueReference="{k}"/>' for k in outputs]
    lines += [f'    <InitialUnknown valueReference="{k}"/>' for k in outputs]
    lines += ["  </ModelStructure>", "</fmiModelDescription>", ""]
    return "\n".join(lines)


def _step(unit: Unit) -> float:
    return next(float(v.start) for v in unit.variables if v.member == "step_s" and isinstance(v.start, float))


def build_description(unit: Unit) -> str:
    """The text of sources/buildDescription.xml."""
    files = "".join(f'\n      <SourceFile name="{name}"/>' for name in unit.sources)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{unit.name}">
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">{files}
    </SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def place_of_binary() -> tuple[str, str]:
    """(folder below binaries/, ending) of this machine in the standard's terms.

    Raises
    ------
    InputError : a system whose libraries are not built here.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    if sys.platform not in LIBRARIES:
        raise InputError(f"--to fmu: the binary is built on Linux and macOS, not on {sys.platform}")
    system, ending = LIBRARIES[sys.platform]
    return f"{machine}-{system}", ending


def identifier(name: str) -> str:
    """A name as a C identifier."""
    plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return plain if plain[:1].isalpha() else f"robot_{plain}"


def build(unit: Unit) -> bytes:
    """The FMU: the same bytes for the same unit, compiler and machine.

    Raises
    ------
    LinkError : no C compiler, or it failed.
    InputError : see `place_of_binary`.
    """
    folder, ending = place_of_binary()
    with temporary_folder() as scratch:
        (scratch / "fmu_values.h").write_text(values_header(unit), encoding="ascii")
        binary = scratch / f"{unit.name}{ending}"
        compile_shared([SOURCES / name for name in unit.sources], binary, [scratch], hide=True)
        content = {
            "modelDescription.xml": description(unit).encode(),
            "sources/buildDescription.xml": build_description(unit).encode(),
            "sources/fmu_values.h": (scratch / "fmu_values.h").read_bytes(),
            **{f"sources/{name}": (SOURCES / name).read_bytes() for name in (*unit.sources, *HEADERS)},
            f"binaries/{folder}/{unit.name}{ending}": binary.read_bytes(),
        }
    return _packed(content)


def _packed(files: Mapping[str, bytes]) -> bytes:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return packed.getvalue()
