"""Forms in an exported file: how a target has them, and their tables as points."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis.forms.curves import named, points_of, told_by
from rtds_host.export.figures import SIDES, Figures
from rtds_host.export.table import AS_NUMBER, OWN, How
from rtds_host.plant import forms

# How each target has a form.
FORMS = {
    "mjcf": How(AS_NUMBER, "custom/numeric form_left_1 and so on, which the Python module that goes along applies"),
    "urdf": How(AS_NUMBER, "comment: its table, and its formula where it has one"),
    "sdf": How(AS_NUMBER, "comment: its table, and its formula where it has one"),
    "usd-json": How(AS_NUMBER, "rtds.forms"),
    "python": How(OWN, "`Robot`"),
}


def written_forms(figures: Figures) -> list[dict]:
    """Tables of a robot's forms: term, side, what it runs over, units of both, the time constant of a heat, s, and
    points [over, value]."""
    found: list[dict] = []
    for name, rows in zip(SIDES, figures.forms, strict=True):
        for row in rows:
            what = named(row)
            if what is None:
                continue
            term, over = what
            low, high = float(row[forms.LOW]), float(row[forms.HIGH])
            y = forms.values_in(row)
            told = told_by(over, y)
            x, y = points_of(over, low, high)[told], y[told]
            if over in forms.PERIODIC:
                x, y = np.append(x, high), np.append(y, y[0])
            points = [[float(f"{v:.7g}") for v in point] for point in zip(x, y, strict=True)]
            slow = {"time_constant": float(row[forms.TAU])} if over == "heat" else {}
            units = list(forms.units_of(term, over))
            found.append({"term": term, "side": name, "over": over, "units": units, **slow, "curve": points})
    return found


def lines_of(entries: list[dict]) -> list[str]:
    """Tables of a diagnosis' forms for a comment."""
    lines = []
    for entry in entries:
        x_unit, y_unit = entry["units"]
        head = f"{entry['term']} ({entry['side']}), {y_unit}, over {entry['over']}, {x_unit}"
        if entry.get("time_constant"):
            head += f", of {entry['time_constant']:.4g} s"
        formula = entry.get("formula")
        if formula:
            sizes = ", ".join(f"{name} = {p['value']:.5g}" for name, p in (entry.get("parameters") or {}).items())
            head += f"; {formula}, {sizes}"
        lines.append(f"  {head}:")
        lines += [f"    {point[0]:.6g} {point[1]:.6g}" for point in entry["curve"]]
    return lines
