"""A picture of a diagnosis' forms: each curve with the 90 % band that its runs allow, and its formula.

rtds diagnose CASE --out said --quick
python -m rtds_host.diagnosis.forms.picture said/diagnosis.json --out forms.png
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rtds_host.contract import check_writable_file
from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.report.words import AXIS_WORDS, OVER_WORDS, form_name, value_name
from rtds_host.diagnosis.thresholds import Z90
from rtds_host.errors import InputError, RtdsError

CURVE = "#1f5fa8"


def forms_in(path: Path) -> list[dict[str, Any]]:
    """The forms of a diagnosis file.

    Raises
    ------
    InputError : it cannot be read, or has no form.
    """
    content = read_json(path)
    forms = content.get("forms") if isinstance(content, dict) else None
    if not isinstance(forms, list) or not forms:
        raise InputError(f"{path}: forms: there is none to draw")
    return forms


def draw(forms: list[dict[str, Any]], out: Path) -> None:
    """Draw forms side by side into a file.

    Raises
    ------
    InputError : the file's ending is no format of pictures.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from rtds_host.correction.figure import STYLE
    from rtds_host.figures import save

    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, len(forms), figsize=(4.6 * len(forms), 3.2), layout="constrained", squeeze=False)
        for axis, form in zip(axes[0], forms, strict=True):
            x, y, error = np.array([[*point, 0.0][:3] for point in form["curve"]], dtype=float).T
            axis.fill_between(x, y - Z90 * error, y + Z90 * error, color=CURVE, alpha=0.2, label="90 %")
            axis.plot(x, y, "o-", color=CURVE, markersize=2.5)
            axis.axhline(0.0, color="#444444", linewidth=0.6)
            units = form["units"]
            over = AXIS_WORDS.get(form["over"], OVER_WORDS.get(form["over"], form["over"]))
            axis.set_xlabel(f"{over} ({units[0]})")
            axis.set_ylabel(f"{value_name(form)} ({units[1]})")
            title = form_name(form) + (f": {form['formula']}" if form.get("formula") else "")
            axis.set_title(title, fontsize=8, parse_math=False)
            axis.legend(loc="best")
        try:
            save(figure, out, dpi=110, metadata={"Software": None} if out.suffix == ".png" else None)
        except ValueError as error:
            raise InputError(f"{out}: {' '.join(str(error).split())}") from error
        finally:
            plt.close(figure)


def main(
    diagnosis: Annotated[Path, typer.Argument(help="A diagnosis.json with forms.")],
    out: Annotated[Path, typer.Option(help="Picture to write, such as forms.png.")],
) -> None:
    """Draw the forms of a diagnosis."""
    try:
        check_writable_file(out)
        draw(forms_in(diagnosis), out)
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error


if __name__ == "__main__":
    typer.run(main)
