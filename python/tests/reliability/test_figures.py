"""Names on figures are text: no formula that cannot be parsed, no escape code and no warning on the terminal."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import pytest

from rtds_host.blind.score import draw
from rtds_host.figures import caption, save

NAMES = (r"a$\frac{$b", "5$ and 6$", "\x1b[31mred", "two\nlines", "\u6f22\u5b57", "\U0001f916", "\udcff")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", ["png", "pdf"])
def test_any_name_can_stand_in_a_caption(tmp_path, capfd, recwarn, name, form):
    figure = plt.figure()
    caption(figure, f"case {name}")
    save(figure, tmp_path / f"figure.{form}")
    plt.close(figure)
    assert (tmp_path / f"figure.{form}").stat().st_size > 1000
    assert list(recwarn) == [] and capfd.readouterr() == ("", "")


def test_any_name_that_a_diagnoser_blames_can_stand_in_the_score(tmp_path, capfd, recwarn):
    records = [
        {
            "truth": [("coulomb_friction", "both")],
            "answered": True,
            "verdict": "known",
            "kind": "known",
            "included": [(name, "both")],
            "calibration": [],
        }
        for name in NAMES
    ]
    draw(records, tmp_path)
    assert (tmp_path / "confusion.png").stat().st_size > 1000
    assert list(recwarn) == [] and capfd.readouterr() == ("", "")
