"""Plots return axes that hold what was asked for; errors explain themselves in a few lines."""

import pickle
import pydoc
import subprocess
import sys

import matplotlib
import numpy as np
import pandas
import pytest

matplotlib.use("agg")
import matplotlib.pyplot as plt

import rtds_host
from rtds_host import plots
from rtds_host.contract import RunLog, RunMeta


@pytest.fixture
def log():
    t = np.arange(50) * 0.01
    return RunLog("run", RunMeta(), t, {"w_l": np.sin(t), "x": t, "y": t**2, "gyro_z": np.full(50, np.nan)})


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def diagnosis(value, side="left"):
    size = {"value": value, "ci90": [0.9 * value, 1.1 * value]}
    of_effect = {"what": "effect", "id": "coulomb_friction", "side": side, "share": 0.9}
    return {
        "effects": [{"id": "coulomb_friction", "side": side, "parameters": {"torque_nm": size}}],
        "gap": {"before": 9.0, "refit": 8.0, "after": 1.1},
        "budget": [of_effect, {"what": "tolerance", "share": 0.1}],
    }


def test_a_channel_has_measured_dots_on_top_of_its_replays(log):
    axes = plots.channel(log, "w_l", replays={"nominal": {"t": log.t, "w_l": 0.9 * log.columns["w_l"]}})
    line, dots = axes.get_lines()
    assert (line.get_label(), dots.get_label()) == ("nominal", "measured")
    assert dots.get_zorder() > line.get_zorder() and np.array_equal(dots.get_ydata(), log.columns["w_l"])
    assert axes.get_ylabel() == "w_l (rad/s)"


def test_a_path_is_drawn_to_one_scale_into_the_axes_that_are_given(log):
    mine = plt.subplots()[1]
    assert plots.path(log, ax=mine) is mine
    assert mine.get_aspect() == 1.0 and len(mine.get_lines()) == 1


def test_what_a_run_does_not_have_is_named(log):
    with pytest.raises(rtds_host.InputError, match="no sample of it; did you mean 'w_l'"):
        plots.channel(log, "w_1")
    with pytest.raises(rtds_host.InputError, match="'gyro_z': the run has no sample"):
        plots.channel(log, "gyro_z")
    with pytest.raises(rtds_host.InputError, match="no path"):
        plots.path(RunLog("run", RunMeta(), log.t, {"w_l": log.t}))


def test_a_gap_is_three_bars_and_a_share_is_in_percent():
    assert [bar.get_height() for bar in plots.gap(diagnosis(0.05)).patches] == [9.0, 8.0, 1.1]
    assert [bar.get_width() for bar in plots.shares(diagnosis(0.05)).patches] == pytest.approx([10.0, 90.0])


def test_sizes_over_cases_are_in_their_order_with_gaps_where_nothing_is_named():
    found = {"a": diagnosis(0.05), "b": {"effects": []}, "c": diagnosis(0.07)}
    axes = plots.sizes(found, "coulomb_friction", "torque_nm")
    (dots,) = axes.get_lines()
    assert list(dots.get_xdata()) == [0, 2] and list(dots.get_ydata()) == [0.05, 0.07]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b", "c"]
    assert not plots.sizes(found, "coulomb_friction", "torque_nm", side="right").get_lines()
    with pytest.raises(rtds_host.InputError, match="did you mean 'coulomb_friction'"):
        plots.sizes(found, "coulomb_fricton", "torque_nm")
    with pytest.raises(rtds_host.InputError, match="no parameter 'torque'"):
        plots.sizes(found, "coulomb_friction", "torque")


def test_a_drive_is_drawn_in_six_panels_and_its_file_leaves_pyplot_alone(tmp_path):
    before = matplotlib.get_backend()
    values = {"duration_s": 0.5}
    outcome = rtds_host.run("crawl", link="model", values=values, out=tmp_path / "run")
    assert (tmp_path / "run" / "figure.png").stat().st_size > 10_000 and not plt.get_fignums()
    assert plots.panels(outcome).shape == (2, 3) and matplotlib.get_backend() == before
    assert plots.channel(outcome, "i_l").get_ylabel() == "i_l (A)"


def test_figures_of_files_do_not_choose_how_a_notebook_shows_its_own():
    command = (
        "import matplotlib; matplotlib.use('svg'); import rtds_host.run.figure, rtds_host.correction.figure; "
        "print(matplotlib.get_backend())"
    )
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout.strip().lower() == "svg"


@pytest.mark.parametrize("name", ["RtdsError", "InputError", "LinkError", "OutputError"])
def test_help_on_an_error_fits_on_a_screen_and_the_error_is_an_ordinary_one(name):
    kind = getattr(rtds_host, name)
    text = pydoc.render_doc(kind, renderer=pydoc.plaintext)
    assert len(text.splitlines()) < 20 and kind.__doc__.split("\n")[0] in text
    back = pickle.loads(pickle.dumps(kind("one line")))
    assert str(back) == "one line" and isinstance(back, rtds_host.RtdsError) and "args" in dir(back)


def test_a_log_is_a_table_for_pandas_or_says_what_to_install(log, monkeypatch):
    table = log.to_pandas()
    assert isinstance(table, pandas.DataFrame) and table.index.name == "t" and list(table.columns) == list(log.columns)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(rtds_host.InputError, match="pip install pandas"):
        log.to_pandas()
