"""What each target can express of each effect, as the effects' own files say it.

    python -m rtds_host.export.table docs/export.md
    python -m rtds_host.export.table docs/mujoco-dcmotor.md

write it into a page, or what differs for MuJoCo's `<dcmotor>`. `python/tests/export` compares the pages with this.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.effects.exported import AS_NUMBER, LEFT_OUT, OWN, TARGETS, USD_FED, How, as_number, own, row

# How each target has each effect; behind a servo's loop where that differs.
TABLE: dict[str, dict[str, How]] = {
    name: dict(CATALOGUE[effect.exports_as or name].exports) for name, effect in CATALOGUE.items()
}
BEHIND_SERVO: dict[str, dict[str, How]] = {
    target: {
        name: effect.exports_behind_servo[target]
        for name, effect in CATALOGUE.items()
        if target in effect.exports_behind_servo
    }
    for target in TARGETS
}
# The loop of a robot that is driven by wheel speeds (`mode = "speed"`).
SERVO = row(
    as_number("custom/numeric servo_kp_v_s_per_rad, servo_ki_v_per_rad, servo_limit_v, servo_period_s"),
    as_number("comment: the loop's gains and limits as torques"),
    own("plugin JointController"),
    as_number(f"{USD_FED} servo"),
)

# What differs with `--actuator dcmotor`.
DCMOTOR: dict[str, How] = {
    name: how
    for name, effect in CATALOGUE.items()
    if (how := CATALOGUE[effect.exports_as or name].exports_dcmotor) is not None
}

START, END = "<!-- export: begin -->", "<!-- export: end -->"
START_DCMOTOR, END_DCMOTOR = "<!-- dcmotor: begin -->", "<!-- dcmotor: end -->"


def markdown() -> str:
    """The table of the documentation."""
    lines = ["| effect | " + " | ".join(f"`{target}`" for target in TARGETS) + " |", "|---" * (len(TARGETS) + 1) + "|"]
    for effect, hows in (("[servo]", SERVO), *sorted(TABLE.items())):
        cells = [
            f"*{how.kind}*: {how.where}" if how.kind != LEFT_OUT else f"left out: {how.where}" for how in hows.values()
        ]
        lines.append(f"| `{effect}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def markdown_of_dcmotor() -> str:
    """What differs with `--actuator dcmotor`, as it is in the documentation."""
    lines = ["| effect | with `--actuator dcmotor` |", "|---|---|"]
    lines += [f"| `{effect}` | *{how.kind}*: {how.where} |" for effect, how in sorted(DCMOTOR.items())]
    return "\n".join(lines) + "\n"


def put_into(page: Path) -> None:
    """Write a table into a page, between its two marks."""
    text = page.read_text(encoding="utf-8")
    for start, end, table in ((START, END, markdown), (START_DCMOTOR, END_DCMOTOR, markdown_of_dcmotor)):
        if start in text:
            before, _, rest = text.partition(start)
            text = f"{before}{start}\n{table()}{end}{rest.partition(end)[2]}"
    page.write_text(text, encoding="utf-8")


__all__ = [
    "BEHIND_SERVO",
    "AS_NUMBER",
    "DCMOTOR",
    "LEFT_OUT",
    "OWN",
    "SERVO",
    "TABLE",
    "TARGETS",
    "How",
    "markdown",
    "markdown_of_dcmotor",
    "put_into",
]

if __name__ == "__main__":
    put_into(Path(sys.argv[1]))
