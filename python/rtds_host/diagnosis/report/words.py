"""A diagnosis in words: effects, values with their units, the verdict in a sentence."""

from __future__ import annotations

import math
from typing import Any

from rtds_host.diagnosis.effects import CATALOGUE

SUBSYSTEM_WORDS = {
    "driver": "driver and supply",
    "winding": "winding",
    "drivetrain": "drivetrain",
    "wheel_ground": "wheel and ground",
    "chassis": "chassis",
    "sensing": "sensing",
    "timing": "timing",
}
# Layout: causes that a headline still names.
LISTED = 2
SIDE_WORDS = {"both": "both sides", "left": "left side", "right": "right side"}
CHANNEL_WORDS = {
    "v_bus": "bus voltage",
    "i": "current",
    "w": "wheel speed",
    "th": "wheel angle",
    "gyro_z": "yaw rate",
    "x": "position x",
    "y": "position y",
    "yaw": "heading",
}
# Values of robot.toml and parameters of effects in words; the files' own names stand next to them in small type.
KEY_NAMES = {
    "resistance_ohm": "winding resistance",
    "inductance_h": "winding inductance",
    "torque_constant_nm_per_a": "torque constant",
    "back_emf_constant_v_s_per_rad": "back-EMF constant",
    "rotor_inertia_kg_m2": "rotor inertia",
    "viscous_friction_nm_s_per_rad": "viscous friction of the motor",
    "kp_v_s_per_rad": "proportional gain of the servo",
    "ki_v_per_rad": "integral gain of the servo",
    "track_width_m": "track width",
    "wheel_radius_m": "wheel radius",
    "yaw_inertia_kg_m2": "yaw inertia",
}
PARAMETER_NAMES = {
    "torque_nm": "friction torque",
    "extra_torque_nm": "extra torque at standstill",
    "speed_rad_s": "speed over which the extra fades",
    "nm_s_per_rad": "viscous friction",
    "volts": "voltage",
    "ratio": "factor",
    "curvature": "curvature",
    "resistance_ohm": "resistance of supply and wiring",
    "rate_v_per_s": "fall of the bus",
    "amperes": "offset of the current",
    "seconds": "delay",
    "delay_s": "delay within it",
    "time_constant_s": "time constant",
    "angle_rad": "free play",
    "restitution": "rebound of the flanks",
    "stiffness_nm_per_rad": "stiffness",
    "damping_nm_s_per_rad": "damping",
    "amplitude_nm": "amplitude",
    "cycles_per_rev": "cycles a turn of the wheel",
    "phase_rad": "phase",
    "slip_per_newton": "slip a newton of traction",
    "softness_m_per_n": "deflection of the tread a newton",
    "damping_n_s_per_m": "damping of the tread",
    "grip": "grip",
    "coefficient": "coefficient",
    "mass_kg": "mass",
    "inertia_kg_m2": "inertia",
    "x_m": "forward",
    "y_m": "to the left",
    "slope_rad": "slope",
    "rad_s": "offset of the yaw rate",
    "rise_per_watt": "rise of the resistance a watt",
}
# Terms of an equation that a form stands for, and what it runs over.
TERM_WORDS = {
    "voltage": "voltage",
    "torque": "torque",
    "damping": "viscous friction",
    "yaw_torque": "torque about the vertical",
    "force": "force along the direction of motion",
    "torque_constant": "torque constant",
    "current_sensor": "current reading",
    "speed_sensor": "speed reading",
    "gyro_sensor": "yaw rate reading",
}
OVER_WORDS = {
    "v_cmd": "command",
    "command_history": "command's history",
    "i": "current",
    "w": "wheel speed",
    "th": "wheel angle",
    "wheel_angle": "wheel angle",
    "motor_angle": "motor angle",
    "yaw_rate": "yaw rate",
    "speed_yaw_rate": "speed times yaw rate",
    "load": "load",
    "t": "time",
    "x": "place x",
    "y": "place y",
    "speed": "speed",
    "yaw": "heading",
    "heat": "heat",
}
# What x is in a form's formula, and what its axis shows, where that takes more words.
X_WORDS = {
    "command_history": "command, and ẋ its last change",
    "load": "torque that the gear transmits, negative where the wheel drives the motor",
    "heat": "heat: the square of the current, which it follows with the time constant",
}
AXIS_WORDS = {
    "command_history": "command's size, negative once it has fallen back",
    "load": "load, negative where the wheel drives the motor",
    "heat": "heat, the square of the current behind a slow filter",
}
# What a form's axis of values shows, where that takes more words.
VALUE_WORDS = {
    ("voltage", "heat"): "voltage, as a share of the command",
    ("torque", "heat"): "torque, along the motion",
    ("damping", "t"): "viscous friction, added to the robot's own",
    ("damping", "heat"): "viscous friction, added to the robot's own",
}
# How sure one may be, from this probability on.
SURENESS = ((0.99, "as good as certain"), (0.9, "very likely"), (0.7, "likely"), (0.0, "more likely than not"))
# Endings of the keys of robot.toml -> their unit.
KEY_UNITS = {
    "_nm_s_per_rad": "N·m·s/rad",
    "_v_s_per_rad": "V·s/rad",
    "_nm_per_a": "N·m/A",
    "_nm_per_v": "N·m/V",
    "_v_per_rad": "V/rad",
    "_kg_m2": "kg·m²",
    "_ohm": "Ω",
    "_kg": "kg",
    "_rad": "rad",
    "_h": "H",
    "_m": "m",
    "_v": "V",
    "_s": "s",
}


def number(value: float | None, digits: int = 3) -> str:
    """A figure with so many significant digits, no exponent where it can be avoided; a dash for None."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text else text


def percent(value: float | None) -> str:
    """A share as whole per cent, with a decimal close to 0 and 1."""
    if value is None or not math.isfinite(value):
        return "–"
    shown = 100.0 * value
    return f"{shown:.1f} %" if 0 < abs(shown) < 1 or 99 < shown < 99.95 else f"{shown:.0f} %"


def percent_closed(value: float | None) -> str:
    """What of a gap is closed; a replay that is closer than the declared noise closes all of it, and no more."""
    return percent(None if value is None else min(value, 1.0))


def plain_name(effect_id: str) -> str:
    """`coulomb_friction` -> "Coulomb friction"."""
    name = effect_id.replace("_", " ")
    return {
        "coulomb friction": "Coulomb friction",
        "stribeck friction": "Stribeck friction",
        "com offset": "centre of mass off the axle",
        "driver deadzone": "driver dead zone",
    }.get(name, name)


def _side(effect: dict[str, Any]) -> str:
    known = CATALOGUE.get(effect["id"])
    return "" if known is not None and not known.sided else SIDE_WORDS[effect["side"]]


def effect_name(effect: dict[str, Any]) -> str:
    """`coulomb_friction`, both -> "Coulomb friction, both sides"; no side where an effect has none."""
    return ", ".join(filter(None, (plain_name(effect["id"]), _side(effect))))


def listed_name(effect: dict[str, Any]) -> str:
    """The same for a list in a sentence, where a comma would part it: "Coulomb friction (both sides)"."""
    side = _side(effect)
    return plain_name(effect["id"]) + (f" ({side})" if side else "")


def enumerated(names: list[str], last: str) -> str:
    """`a, b and c` with "and" as `last`."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def explanation_name(effects: list[dict[str, Any]] | str) -> str:
    """An alternative of the contract as words."""
    if isinstance(effects, str):  # "unknown"
        return "none of the catalogue"
    return " and ".join(effect_name(e) for e in effects) if effects else "no effect"


def channel_name(channel: str) -> str:
    """`w_l` -> "left wheel speed (w_l)"; a channel that the contract does not name stays as it is."""
    stem, _, side = channel.rpartition("_")
    if side in ("l", "r") and stem in CHANNEL_WORDS:
        return f"{'left' if side == 'l' else 'right'} {CHANNEL_WORDS[stem]} ({channel})"
    return f"{CHANNEL_WORDS[channel]} ({channel})" if channel in CHANNEL_WORDS else channel


def parameter_name(key: str, of_robot: bool = False) -> str:
    """An effect's parameter, or a value of robot.toml, in words; a name that nobody has put into words as it is."""
    names = KEY_NAMES if of_robot else PARAMETER_NAMES
    return names.get(key, key.replace("_", " "))


def form_name(form: dict[str, Any]) -> str:
    """A form of the contract as words: "torque over yaw rate, both sides"."""
    term, over = form["term"], form["over"]
    side = "" if term in ("yaw_torque", "force", "gyro_sensor") else f", {SIDE_WORDS[form['side']]}"
    return f"{TERM_WORDS.get(term, term.replace('_', ' '))} over {OVER_WORDS.get(over, over.replace('_', ' '))}{side}"


def value_name(form: dict[str, Any]) -> str:
    """What the axis of a form's values shows."""
    term = form["term"]
    return VALUE_WORDS.get((term, form["over"]), TERM_WORDS.get(term, term))


def scatter_words(effect: dict[str, Any]) -> str:
    """How constant an effect's size is, "" where the diagnosis says nothing of it."""
    scatter = effect.get("scatter")
    if scatter is None:
        return ""
    setting = effect.get("scatters_with")
    over = f" with {OVER_WORDS.get(setting, setting.replace('_', ' '))}" if setting else " between settings"
    return f"size varies by {percent(scatter)}{over}"


def sureness(probability: float) -> str:
    """A probability in a phrase."""
    return next(words for least, words in SURENESS if probability >= least)


def key_unit(key: str) -> str:
    """Unit of a key of robot.toml, which its name ends in; "" for a plain number."""
    return next((unit for ending, unit in KEY_UNITS.items() if key.endswith(ending)), "")


def unit_of(effect_id: str, parameter: str) -> str:
    """Unit of an effect's parameter, "" for a plain number."""
    known = CATALOGUE.get(effect_id)
    for p in known.parameters if known else ():
        for name, unit in ((p.name, p.unit), *(p.declared or {}).values()):
            if name == parameter:
                return "" if unit in ("1", "") else unit
    return ""


def value_words(effect_id: str, parameter: str, entry: Any) -> str:
    """A parameter with unit and interval."""
    value, interval = (entry.get("value"), entry.get("ci90")) if isinstance(entry, dict) else (entry, None)
    unit = unit_of(effect_id, parameter)
    text = number(value, 4) + (f" {unit}" if unit else "")
    if interval is not None and all(v is not None for v in interval):
        text += f" ({number(interval[0], 4)} to {number(interval[1], 4)})"
    return text


def budget_words(diagnosis: dict[str, Any]) -> list[tuple[str, float]]:
    """What the gap is made of: words and shares in the file's order, effects first, what is unmodelled last."""
    rows = []
    for row in diagnosis["budget"]:
        if row["what"] == "effect":
            text = effect_name(row)
        elif row["what"] == "form":
            text = f"free curve: {form_name(row)}"
        elif row["what"] == "tolerance":
            text = "tolerances of the motors"
        else:
            text = "unmodelled, " + (SUBSYSTEM_WORDS[row["subsystem"]] if row["subsystem"] else "place not known")
        rows.append((text, row["share"]))
    return rows


def by_share(diagnosis: dict[str, Any]) -> list[dict[str, Any]]:
    """The included effects, the one that makes most of the gap first."""
    shares = {(row["id"], row["side"]): row["share"] for row in diagnosis["budget"] if row["what"] == "effect"}
    return sorted(diagnosis["effects"], key=lambda e: -shares.get((e["id"], e["side"]), 0.0))


def headline(diagnosis: dict[str, Any]) -> str:
    """The verdict for whoever opens the report: a sentence without figures."""
    verdict = diagnosis["verdict"]
    place = SUBSYSTEM_WORDS.get((diagnosis["gap"].get("rest") or {}).get("subsystem") or "")
    if verdict == "none":
        return "Nothing is missing: the simulator follows this robot as closely as its sensors can tell."
    if verdict == "unknown":
        return "The simulator differs from this robot, and no effect of the catalogue explains it" + (
            f". Most of the difference shows in the {place}." if place else "."
        )
    several = len(diagnosis["effects"]) > LISTED
    names = [
        enumerated([listed_name(one) for one in (e, *indistinguishable_from(diagnosis, e))], "or")
        for e in by_share(diagnosis)
    ]
    # Beyond two, names and look-alikes stand in the list below.
    listed = f"{len(names)} causes" if several else enumerated(names, "and")
    listed = listed[0].upper() + listed[1:]
    open_end = " These runs cannot tell which." if diagnosis["indistinguishable"] and not several else ""
    if verdict == "partial":
        return (
            f"{listed} {'explains' if len(names) == 1 else 'explain'} a part of the difference between simulator "
            "and robot. "
            "The remainder is unmodelled" + (f"; most of it shows in the {place}." if place else ".") + open_end
        )
    return f"{listed} {'makes' if len(names) == 1 else 'make'} this robot differ from its simulator.{open_end}"


def manoeuvre(plan: dict[str, Any]) -> str:
    """A next experiment's manoeuvre: "teleop", "uphill with a payload of 2 kg"."""
    scenario, _, payload = str(plan["scenario"]).partition(" --payload ")
    return scenario + (f" with a payload of {payload} kg" if payload else "")


def indistinguishable_from(diagnosis: dict[str, Any], effect: dict[str, Any]) -> list[dict[str, str]]:
    """What these runs cannot tell from an included effect."""
    me = (effect["id"], effect["side"])
    return [
        m
        for causes in diagnosis["indistinguishable"]
        if me in {(m["id"], m["side"]) for m in causes}
        for m in causes
        if (m["id"], m["side"]) != me
    ]


def verdict_sentence(diagnosis: dict[str, Any]) -> str:
    """The verdict with its figures, in a few sentences for the terminal."""
    gap, effects = diagnosis["gap"], diagnosis["effects"]
    after, refit = gap.get("after"), gap.get("refit")
    if diagnosis["verdict"] == "none":
        return (
            f"Nothing is missing: with its motor values refitted, the nominal robot explains these runs; the gap is "
            f"{number(refit)} times the sensors' noise."
        )
    residual = gap.get("rest") or {}
    place = SUBSYSTEM_WORDS.get(residual.get("subsystem") or "")
    if not effects:
        text = "There is a gap, and no effect of the catalogue has evidence of its own"
        return text + (f"; most of it lies in the {place}." if place else ".")

    def sized(effect: dict[str, Any]) -> str:
        values = (value_words(effect["id"], n, {"value": p["value"]}) for n, p in effect["parameters"].items())
        return f"{effect_name(effect)} ({', '.join(values)})"

    names = "; ".join(sized(effect) for effect in effects)
    closed = gap.get("effect_closed")
    of_it = f"{percent_closed(closed)} closed; " if closed is not None else ""
    each = "each at least " if len(effects) > 1 else ""
    sure = f": {each}{percent(min(e['probability'] for e in effects))} probable"
    probable = "" if any(indistinguishable_from(diagnosis, e) for e in effects) else sure
    where = "halves of the run" if len(diagnosis.get("held_out_runs") or []) == 1 else "runs"
    text = (
        f"{names[:1].upper()}{names[1:]}{probable}. With motor values refitted, the gap on held-out {where} falls "
        f"from {number(refit)} to {number(after)} times the sensors' noise ({of_it}nominal "
        f"{number(gap.get('before'))})."
    )
    if diagnosis["verdict"] == "partial":
        text += f" {percent(residual.get('share'))} of it is unmodelled" + (
            f", most of that in the {place}." if place else "."
        )
    included = {(e["id"], e["side"]): e["probability"] for e in effects}
    for causes in diagnosis["indistinguishable"]:
        mine = [m for m in causes if (m["id"], m["side"]) in included]
        others = [m for m in causes if (m["id"], m["side"]) not in included]
        if mine and others:
            share = percent(included[mine[0]["id"], mine[0]["side"]])
            text += (
                f" These runs cannot distinguish {listed_name(mine[0])} from "
                f"{enumerated([listed_name(m) for m in others], 'or')}, so their probability is shared: {share} for "
                "the first."
            )
    return text
