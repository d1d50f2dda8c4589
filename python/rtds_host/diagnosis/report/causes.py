"""What causes the gap: each effect with its parameters, whole explanations, and what was refitted and is no cause."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.details import Candidate, Details
from rtds_host.diagnosis.report.first import in_words, parameter
from rtds_host.diagnosis.report.html import bar, section, table
from rtds_host.diagnosis.report.words import (
    channel_name,
    effect_name,
    enumerated,
    explanation_name,
    indistinguishable_from,
    key_unit,
    listed_name,
    number,
    parameter_name,
    percent,
    scatter_words,
    value_words,
)

SETUP_WORDS = {
    "latency_s": ("delay of speed commands on their way", 1e3, "ms"),
    "anti_windup": ("anti-windup: share of the clipped voltage that the servo's integral gives up", 1.0, ""),
    "command_early_s": ("a command acts before the row that shows it by", 1e3, "ms"),
    "encoder_at_wheel": ("the encoder sits on the wheel, behind spring and free play", 1.0, ""),
    "gyro_delay_s": ("the gyro's clock is behind the wheels' by", 1e3, "ms"),
    "pose_delay_s": ("the pose's clock is behind the wheels' by", 1e3, "ms"),
}
EFFECTS_HEAD = (
    ("effect", False),
    ("probability", True),
    ("parameter", False),
    ("nominal", True),
    ("fitted", True),
    ("unit", False),
    ("90 % interval", True),
    ("gap without it", True),
    ("channel that decided", False),
)


def _small(text: str) -> str:
    return f'<br><span class="small soft">{escape(text)}</span>' if text else ""


def _parameter_cell(effect: dict[str, Any], shown: str, name: str) -> str:
    """The parameter in words, what it means, and in small type its name in the file."""
    known = CATALOGUE.get(effect["id"])
    meaning = next((p.meaning for p in known.parameters if p.name == name), "") if known else ""
    code = f'<code class="file">{escape(shown)}</code>'
    return f"{escape(in_words(shown, name))} {code}" + _small(meaning)


def _surely(diagnosis: dict[str, Any], effect: dict[str, Any], details: Details) -> str:
    """Probability that a cause is present, and what is known of how constant and how repeatable it is."""
    text = escape(percent(effect["probability"]))
    if indistinguishable := indistinguishable_from(diagnosis, effect):
        text += _small(f"shared with {enumerated([listed_name(equal) for equal in indistinguishable], 'and')}")
    text += _small(scatter_words(effect))
    if repeats := details.repeats.get((effect["id"], effect["side"])):
        text += _small(f"found on {repeats[0]} of {repeats[1]} halves of the data")
    return text


def _effect_rows(diagnosis: dict[str, Any], effect: dict[str, Any], details: Details) -> list[tuple[list[str], str]]:
    """Cells and attributes of an effect's rows, a row a parameter; what holds for all is in the first."""
    decided = details.decided.get((effect["id"], effect["side"]))
    channel = (
        f"{channel_name(decided[0])}: {number(decided[1])} without it, {number(decided[2])} with it" if decided else ""
    )
    rows = []
    for k, (name, p) in enumerate(effect["parameters"].items()):
        shown, nominal, fitted, unit = parameter(effect, name, p["value"], details)
        interval = p.get("ci90")
        pinned = (
            "not determined by these runs"
            if interval is None
            else " to ".join(parameter(effect, name, v, details)[2] for v in interval)
        )
        first = k == 0
        cells = [
            escape(effect_name(effect)) if first else "",
            _surely(diagnosis, effect, details) if first else "",
            _parameter_cell(effect, shown, name),
            nominal,
            fitted,
            escape(unit),
            pinned,
            number(effect["gap_without"]) if first else "",
            escape(channel) if first else "",
        ]
        attributes = f'data-id="{effect["id"]}" data-side="{effect["side"]}" data-parameter="{escape(name)}"'
        rows.append((cells, f'class="effect" {attributes}'))
    return rows


def _effects(diagnosis: dict[str, Any], details: Details) -> str:
    if not diagnosis["effects"]:
        return '<p class="soft">No effect is named.</p>'
    rows = [row for effect in diagnosis["effects"] for row in _effect_rows(diagnosis, effect, details)]
    parts = [table(EFFECTS_HEAD, [cells for cells, _ in rows], [attributes for _, attributes in rows], "effects")]
    parts.append(
        '<p class="small soft">The probability is that the cause is present in this robot, given these runs. '
        "Causes that look the same share it.</p>"
    )
    for effect in diagnosis["effects"]:
        known = CATALOGUE.get(effect["id"])
        if known:
            parts.append(f'<p class="small soft">{escape(effect_name(effect))}: {escape(known.equation)}</p>')
    return "".join(parts)


def _key(effects: list[dict[str, Any]] | str) -> Any:
    return effects if isinstance(effects, str) else tuple(sorted((e["id"], e["side"]) for e in effects))


def _explanation(
    effects: list[dict[str, Any]] | str, probability: float | None, candidate: Candidate | None
) -> list[str]:
    fitted = ""
    if candidate is not None and candidate.parameters:
        fitted = _small(
            "; ".join(
                f"{parameter_name(name)} = {value_words(e['id'], name, entry)}"
                for e, values in zip(candidate.effects, candidate.parameters, strict=False)
                for name, entry in values.items()
            )
        )
    share = percent(probability) if probability is not None else "–"
    return [
        escape(explanation_name(effects)) + fitted,
        bar(probability, 1.0, "", 60) + f'<span class="value">{share}</span>',
        number(candidate.improvement) if candidate else "–",
        escape(candidate.reason) if candidate else "",
    ]


def _explanations(diagnosis: dict[str, Any], details: Details) -> str:
    """Whole sets of causes that were weighed, and those that were only tried."""
    reasons = {_key(c.effects): c for c in details.candidates}
    included = _key(diagnosis["effects"])
    rows, attributes, seen = [], [], set()
    for alternative in diagnosis["alternatives"]:
        key = _key(alternative["effects"])
        seen.add(key)
        rows.append(_explanation(alternative["effects"], alternative["probability"], reasons.get(key)))
        attributes.append(
            f'data-probability="{alternative["probability"]:.6g}"'
            + (' class="included"' if key == included and diagnosis["verdict"] != "unknown" else "")
        )
    head = [("exactly these causes", False), ("weight", True), ("explains, noise²", True), ("why", False)]
    parts = [
        "<h3>Sets of causes, best first</h3>",
        "<p class=\"small soft\">A set's weight is for exactly these causes and no other. A cause's probability above "
        "adds up the sets that hold it.</p>",
        table(head, rows, attributes, "alternatives"),
    ]
    others = [c for c in details.candidates if _key(c.effects) not in seen]
    if others:
        parts.append(f"<details><summary>{len(others)} more that were tried</summary>")
        parts.append(table(head, [_explanation(c.effects, c.probability, c) for c in others], None, "rejected"))
        parts.append("</details>")
    return "".join(parts)


def _nominal(details: Details, key: str) -> float | None:
    robot = details.case.robot
    return next(
        (getattr(part, key) for part in (robot.motor, robot.servo, robot.chassis, robot.axis) if hasattr(part, key)),
        None,
    )


def _refitted(diagnosis: dict[str, Any], details: Details) -> str:
    parts = []
    moved = {s: v for s, v in (diagnosis.get("nominal_fit") or {}).items() if v}
    if moved:
        rows = [
            [
                {"l": "left", "r": "right"}.get(s, s),
                f'{escape(parameter_name(name, of_robot=True))} <code class="file">{escape(name)}</code>',
                number(_nominal(details, name), 5),
                number(value, 5),
                escape(key_unit(name)),
            ]
            for s, values in sorted(moved.items())
            for name, value in values.items()
        ]
        head = [("side", False), ("value", False), ("nominal", True), ("refitted", True), ("unit", False)]
        parts.append("<h3>Constants refitted within their tolerance (no cause)</h3>")
        parts.append(table(head, rows, None, "nominal_fit"))
    if setup := diagnosis.get("setup"):
        rows = [
            [escape(text), number(one * value, 3), unit]
            for (text, one, unit), value in ((SETUP_WORDS[name], value) for name, value in setup.items())
        ]
        parts.append("<h3>Clocks and servo (no cause)</h3>")
        parts.append(table([("what", False), ("refitted", True), ("unit", False)], rows, None, "setup"))
    return "".join(parts)


def what(diagnosis: dict[str, Any], details: Details) -> str:
    """The section on causes."""
    body = _effects(diagnosis, details) + _explanations(diagnosis, details) + _refitted(diagnosis, details)
    return section("causes", "What causes it", body)
