"""A draft mapping from a csv's header or a bag's topics: channels and units by their names, each marked as a guess."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from rtds_host.contract.inputs import open_regular
from rtds_host.errors import InputError, shown, visible
from rtds_host.importers.units import QUANTITY, known_units

# Characters of a header that are looked at, columns that are gone through.
LONGEST_HEADER, MOST_COLUMNS = 2**20, 2000
DELIMITERS = (",", ";", "\t")
# A channel without its side, and words of a column's name that mean it, tried in this order.
MEANINGS = (
    ("v_bus", ("v_bus", "vbus", "battery", "vbat", "supply", "bus_voltage", "vin")),
    ("gyro_z", ("gyro_z", "gyro", "yaw_rate", "yawrate", "omega_z", "angular_velocity_z")),
    ("yaw", ("yaw", "heading", "theta_robot")),
    ("w_ref", ("w_ref", "speed_ref", "target", "setpoint", "reference")),
    ("w_cmd", ("w_cmd", "speed_cmd", "vel_cmd", "cmd_vel", "cmd_speed")),
    ("v_cmd", ("v_cmd", "duty", "pwm", "voltage", "volt", "command", "cmd", "power")),
    ("i", ("current", "amps", "amp", "ia", "i")),
    ("w", ("speed", "velocity", "vel", "rpm", "omega", "w", "rate")),
    ("th", ("angle", "position", "pos", "encoder", "enc", "ticks", "count", "counts", "theta", "th")),
    ("x", ("x",)),
    ("y", ("y",)),
)
SIDES = {"l": ("l", "left", "lft", "0", "1"), "r": ("r", "right", "rgt", "2")}
TIMES = ("t", "time", "timestamp", "stamp", "seconds", "sec", "ms", "millis", "us", "micros", "ns")
# A word in a column's name -> the unit that it means.
UNIT_WORDS = {
    "mv": "mV",
    "v": "V",
    "duty": "duty",
    "percent": "%",
    "pct": "%",
    "pwm": "pwm",
    "ma": "mA",
    "ua": "uA",
    "a": "A",
    "rpm": "rpm",
    "deg": "deg",
    "degrees": "deg",
    "dps": "deg/s",
    "ticks": "counts",
    "counts": "counts",
    "count": "counts",
    "enc": "counts",
    "encoder": "counts",
    "rev": "rev",
    "mm": "mm",
    "cm": "cm",
    "m": "m",
    "rad": "rad",
}
TIME_WORDS = {"ms": "ms", "millis": "ms", "us": "us", "micros": "us", "ns": "ns"}


def words_of(name: str) -> list[str]:
    """A column's name in small words: `motorLeft_rpm` is motor, left, rpm."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return [word for word in re.split(r"[^a-z0-9]+", parted.lower()) if word]


def channel_of(name: str) -> str | None:
    """The contract's channel that a column's name means, None where it means none."""
    if name in QUANTITY:
        return name
    words = words_of(name)
    joined = "_".join(words)
    sides = [side for side, all_names in SIDES.items() if any(word in all_names for word in words)]
    for meaning, keys in MEANINGS:
        if not any(key in words or ("_" in key and key in joined) for key in keys):
            continue
        if meaning in QUANTITY:
            return meaning
        return f"{meaning}_{sides[0]}" if len(sides) == 1 else None
    return None


def unit_of(name: str, channel: str) -> str:
    """The unit that a column's name tells, or the SI unit."""
    known = known_units(QUANTITY[channel])
    # `_mA` is one word here, though it has a small and a capital letter.
    words = words_of(name) + re.split(r"[^a-z0-9]+", name.lower())
    for word in reversed(words):
        unit = UNIT_WORDS.get(word)
        for candidate in (unit, f"{unit}/s"):
            if unit is not None and candidate in known:
                return candidate
    return known[0]


def header_of(path: Path) -> tuple[list[str], str]:
    """Columns of a csv file and the character between them.

    Raises
    ------
    InputError : it cannot be read, is no text, or has no header.
    """
    try:
        with open_regular(path) as stream:
            text = stream.read(LONGEST_HEADER).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    line = text.splitlines()[0] if text.strip() else ""
    if not line.strip() or "\0" in line:
        raise InputError(f"{path}: row 1: a header line with the names of the columns is needed")
    delimiter = max(DELIMITERS, key=line.count)
    try:
        names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise InputError(f"{path}: row 1: is not a row of a csv file ({error})") from error
    if len(names) < 2:
        raise InputError(f"{path}: row 1: has one name, {shown(line)}; a time and a channel at least are needed")
    return names[:MOST_COLUMNS], delimiter


def _quoted(text: str) -> str:
    # What steers a terminal is no TOML; both write a backslash the same way.
    return '"' + visible(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _more(unit: str) -> str:
    """What a unit needs besides, as a line to fill in."""
    return {
        "counts": "counts_per_rev = 1000              # guess: put in what one turn of `shaft` has\n",
        "counts/s": "counts_per_rev = 1000              # guess: put in what one turn of `shaft` has\n",
        "pwm": "full_scale = 255                   # guess: counts at full duty\n",
    }.get(unit, "")


def draft_mapping(path: Path) -> str:
    """The text of a mapping for a recording, each guess marked as one.

    Raises
    ------
    InputError : the recording cannot be read, or nothing in it has a name that says what it is.
    """
    from rtds_host.importers.bag import is_bag, refuse_other

    refuse_other(path)
    if path.suffix == ".wpilog":
        raise InputError(f"{path}: drafts are made of bags and csv files; `rtds import --list` shows a log's entries")
    return _draft_of_bag(path) if is_bag(path) else _draft_of_csv(path)


def _draft_of_csv(path: Path) -> str:
    names, delimiter = header_of(path)
    time = next((name for name in names if set(words_of(name)) & set(TIMES)), names[0])
    unit = next((TIME_WORDS[word] for word in words_of(time) if word in TIME_WORDS), "s")
    found: dict[str, str] = {}
    ignored = []
    for name in names:
        channel = channel_of(name) if name != time else None
        if channel is not None and channel not in found:
            found[channel] = name
        elif name != time:
            ignored.append(name)
    if not found:
        raise InputError(f"{path}: row 1: no column has a name that says what it is; docs/import.md shows a mapping")
    lines = [
        f"# A draft by `rtds init` from the header of {visible(path.name)}: names and units are guessed from",
        "# the columns' names. Look at each line that says `guess` and take the word out.",
        "# Units and keys: docs/import.md.",
        'schema = "rtds-mapping/1"',
        "",
        "[table]",
        f"delimiter = {_quoted(delimiter) if delimiter != chr(9) else chr(34) + chr(92) + 't' + chr(34)}",
        "",
        "[time]",
        f"column = {_quoted(time)}",
        f'unit = "{unit}"                         # guess: s, ms, us or ns',
    ]
    for channel in sorted(found, key=list(QUANTITY).index):
        unit = unit_of(found[channel], channel)
        lines += [
            "",
            f"[signal.{channel}]",
            f"column = {_quoted(found[channel])}",
            f'unit = "{unit}"                         # guess: one of {", ".join(known_units(QUANTITY[channel]))}',
        ]
        lines += [_more(unit).rstrip()] if _more(unit) else []
    if ignored:
        some = ", ".join(visible(name)[:60] for name in ignored[:20])
        lines += ["", f"# Not used: {some}" + (f" and {len(ignored) - 20} more" if len(ignored) > 20 else "")]
    missing = [c for c in ("v_cmd_l", "v_cmd_r") if c not in found and c.replace("v_", "w_") not in found]
    if missing:
        lines += ["", f"# Missing: {', '.join(missing)} (or w_cmd_l, w_cmd_r); a case needs its commands."]
    return "\n".join(lines) + "\n"


# Type of a message -> (channel or kind, field, unit) that a mapping usually takes from it.
TYPES: dict[str, tuple[tuple[str, str, str], ...]] = {
    "sensor_msgs/msg/Imu": (("gyro_z", "angular_velocity.z", "rad/s"),),
    "sensor_msgs/msg/BatteryState": (("v_bus", "voltage", "V"),),
    "geometry_msgs/msg/PoseStamped": (("x", "pose.position.x", "m"), ("y", "pose.position.y", "m")),
}
JOINTS = "sensor_msgs/msg/JointState"
TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")


def _draft_of_bag(path: Path) -> str:
    from rtds_host.importers.bag import list_topics

    topics = list_topics(path)
    lines = [
        f"# A draft by `rtds init` from the topics of {visible(path.name)}: what each holds is guessed from its type.",
        "# Look at each line that says `guess` and take the word out. Units and keys: docs/import.md.",
        'schema = "rtds-mapping/1"',
    ]
    used: set[str] = set()
    seen: set[str] = set()
    for topic, kind, _ in topics:
        if kind == JOINTS and not {"w_l"} & seen:
            for side, joint in (("l", "wheel_left_joint"), ("r", "wheel_right_joint")):
                for channel, name, unit in (("w", "velocity", "rad/s"), ("th", "position", "rad")):
                    lines += _signal(f"{channel}_{side}", topic, name, unit, joint)
                    seen.add(f"{channel}_{side}")
            used.add(topic)
        elif kind in TWISTS and "twist" not in seen:
            prefix = "twist." if kind.endswith("Stamped") else ""
            lines += [
                "",
                "[twist]                            # guess: the command of the whole robot",
                f"topic = {_quoted(topic)}",
            ]
            lines += [f'linear = "{prefix}linear.x"', f'angular = "{prefix}angular.z"']
            seen.add("twist")
            used.add(topic)
        for channel, name, unit in TYPES.get(kind, ()):
            if channel not in seen:
                lines += _signal(channel, topic, name, unit)
                seen.add(channel)
                used.add(topic)
    if not used:
        raise InputError(f"{path}: no topic is of a type that says what it holds; docs/import.md shows a mapping")
    rest = [f"{topic} ({kind})" for topic, kind, _ in topics if topic not in used]
    if rest:
        lines += ["", *(f"# Not used: {visible(one)[:200]}" for one in rest[:50])]
    return "\n".join(lines) + "\n"


def _signal(channel: str, topic: str, name: str, unit: str, joint: str | None = None) -> list[str]:
    lines = ["", f"[signal.{channel}]", f"topic = {_quoted(topic)}", f'field = "{name}"']
    if joint is not None:
        lines.append(f'joint = "{joint}"         # guess: the name in the messages')
    return [
        *lines,
        f'unit = "{unit}"                         # guess: one of {", ".join(known_units(QUANTITY[channel]))}',
    ]
