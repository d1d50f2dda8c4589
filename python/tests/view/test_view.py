"""The live view: what its page is given, who may ask for it, and the page in a real browser."""

import http.client
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from urllib.request import urlopen

import numpy as np
import pytest

from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, read_run, write_run
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS
from rtds_host.run import LinkChoice, Options, SignalPath, drive_with, make_plan, perform
from rtds_host.view import Feed, LivePath, Viewer, lines_of_run
from rtds_host.view.command import recorded

FRICTION_NM = 0.05
# A run of a second.
SHORT = {"duration_s": 1.0, "ramp_s": 0.4, "stop_s": 0.4, "length_m": 0.1}


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A case of two short runs of a robot with dry friction, and the diagnosis of it."""
    place = tmp_path_factory.mktemp("case")
    shutil.copy(builtin_robot_path("burger"), place / "robot.toml")
    robot = builtin_robot("burger")
    truth = nominal_model(robot)
    truth.add("coulomb", FRICTION_NM)
    for name, turn in (("left", 1.0), ("right", -1.0)):
        t = np.arange(151) * 0.02
        volts = np.where(t < 0.2, 0.0, 4.0)
        columns = {"v_cmd_l": volts - turn * np.minimum(t, 1.0), "v_cmd_r": volts + turn * np.minimum(t, 1.0)}
        log = RunLog(name, RunMeta(scenario=name), t, columns)
        out = replay_run(truth, run_inputs(log, robot))
        columns |= {channel: out[:, k] for k, channel in enumerate(OUTPUTS)}
        write_run(place / name, log.meta, {"t": t, **columns}, "csv")
    effect = {
        "id": "coulomb_friction",
        "side": "both",
        "parameters": {"torque_nm": {"value": FRICTION_NM, "ci90": None}},
    }
    (place / "diagnosis.json").write_text(json.dumps({"schema": "rtds-diagnosis/3", "effects": [effect]}))
    return place


# ---- what the page is given ----------------------------------------------------------------------------------------


def test_a_run_has_its_measured_line_and_the_replay_with_the_truth_lies_on_it(case):
    left, right = recorded([case], None, case / "diagnosis.json")
    assert (left.name, right.name) == ("left", "right") and set(left.layers) == {"measured", "nominal", "corrected"}
    measured, nominal, corrected = (np.array(left.layers[k]["w_l"]) for k in ("measured", "nominal", "corrected"))
    assert np.abs(corrected - measured).max() < 1e-3 < 0.1 < np.abs(nominal - measured).max()
    assert all(len(values) == 151 for layer in left.layers.values() for values in layer.values())


def test_a_long_run_is_thinned_and_a_missing_sample_is_null(case):
    robot = builtin_robot("burger")
    log = read_run(case / "left", robot)
    t = 1.7e9 + np.arange(9000) * 0.01
    columns = {
        "v_cmd_l": np.zeros(9000),
        "v_cmd_r": np.zeros(9000),
        "w_l": np.where(np.arange(9000) < 4500, np.nan, 1.0),
    }
    lines = lines_of_run(RunLog("long", log.meta, t, columns))
    measured = lines.layers["measured"]
    assert len(measured["t"]) == 1500 and measured["t"][0] == 0.0 and measured["t"][-1] == pytest.approx(89.99)
    assert measured["w_l"][0] is None and measured["w_l"][-1] == 1.0 and set(lines.layers) == {"measured"}


def test_a_run_that_is_watched_is_the_same_run_and_its_rows_are_the_logs():
    plan = make_plan("linear", SHORT, Options())
    alone = drive_with(plan, "model")
    feed = Feed()
    path = LivePath(SignalPath(plan.robot.supply_v), plan, feed)
    watched = drive_with(plan, "model", path=path)
    np.testing.assert_array_equal(alone.speeds, watched.speeds)
    np.testing.assert_array_equal(alone.applied, watched.applied)
    (run,) = feed.json([])["runs"]
    assert run["done"] is False and {"reference", "measured"} == set(run["layers"])
    rows = run["layers"]["measured"]
    at = [watched.t_s[watched.rows].tolist().index(pytest.approx(t)) for t in rows["t"]]
    assert rows["x"] == pytest.approx([watched.samples[k].x_m for k in at], rel=1e-6, abs=1e-12)
    assert len(rows["t"]) > 40 and rows["w_ref_l"][-1] == pytest.approx(
        watched.references[watched.rows[at[-1]], 0], rel=1e-5, abs=1e-9
    )


def test_a_rival_engines_run_is_not_mixed_into_the_page():
    plan = make_plan("linear", SHORT, Options())
    feed = Feed()
    path = LivePath(SignalPath(plan.robot.supply_v), plan, feed)
    perform(plan, LinkChoice("model"), compare=False, path=path)
    path.end()
    times = feed.json([])["runs"][0]["layers"]["measured"]["t"]
    assert times[-1] == pytest.approx(plan.duration_s)
    drive_with(plan, "model", path=path)
    after = feed.json([])["runs"][0]
    assert after["layers"]["measured"]["t"] == times and after["done"]


def test_only_new_rows_are_sent():
    feed = Feed()
    number = feed.add(lines_of_run(RunLog("r", RunMeta(scenario="r"), np.arange(3.0), {"w_l": np.arange(3.0)})))
    feed.extend(number, "measured", {"t": 3.0, "w_l": 7.0})
    (run,) = feed.json([3])["runs"]
    assert run["layers"]["measured"] == {"t": [3.0], "w_l": [7.0]} and run["since"] == 3


# ---- who may ask ---------------------------------------------------------------------------------------------------


def asked(address, path, host=None):
    """Status and body of a request to a viewer."""
    name, port = address.removeprefix("http://").strip("/").split(":")
    link = http.client.HTTPConnection(name, int(port), timeout=10)
    link.request("GET", path, headers={"Host": host} if host else {})
    answer = link.getresponse()
    return answer.status, answer.read()


def test_the_page_is_served_on_loopback_only_and_under_its_own_name_only(case):
    with Viewer(Feed(recorded([case / "left"], None, None))) as viewer:
        assert viewer.address.startswith("http://127.0.0.1:")
        assert asked(viewer.address, "/")[0] == 200 and asked(viewer.address, "/runs.json?since=")[0] == 200
        assert asked(viewer.address, "/", host="evil.example:80")[0] == 403
        for path in ("/../robot.toml", "/view.py", "/etc/passwd", "/runs.json?since=" + "1," * 2000):
            assert asked(viewer.address, path)[0] == 404
        status, body = asked(viewer.address, "/runs.json?since=-1,x,%00")
        assert status == 200 and len(json.loads(body)["runs"][0]["layers"]["measured"]["t"]) == 151


def test_a_port_that_is_taken_is_one_line(case):
    with Viewer(Feed()) as viewer:
        port = int(re.search(r":(\d+)/", viewer.address)[1])
        done = run_rtds("view", case, "--no-browser", "--port", port)
    assert done.returncode == 2 and re.fullmatch(rf"rtds: --port {port}: cannot be listened at \(.*\)\n", done.stderr)


def environment(**more):
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **more}


def run_rtds(*words, **more):
    """`rtds WORDS…` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "rtds_host.cli.main", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env=environment(**more),
        timeout=120,
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere",), "nowhere"),
        (("CASE", "--robot", "no.toml"), "no.toml"),
        (("CASE", "--diagnosis", "no.json"), "no.json"),
    ],
)
def test_what_cannot_be_read_is_one_line(case, words, said):
    done = run_rtds("view", "--no-browser", *(case if word == "CASE" else word for word in words))
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and said in done.stderr


def test_a_window_without_a_display_is_refused_before_the_run(tmp_path):
    words = ("run", "linear", "--link", "model", "--gui", "--out", tmp_path / "out")
    done = run_rtds(*words, DISPLAY="", WAYLAND_DISPLAY="")
    assert done.returncode == 2 and done.stderr == (
        "rtds: --gui: there is no display here (DISPLAY is not set); --live needs none\n"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("live", [False, True])
def test_the_commands_serve_until_ctrl_c_and_end_in_order(case, tmp_path, live):
    words = ["view", case, "--no-browser"]
    if live:
        words = [
            "run",
            "linear",
            "--link",
            "model",
            *(f"--set={k}={v}" for k, v in SHORT.items()),
            "--no-figure",
            "--no-compare",
            "--live",
            "--no-browser",
        ]
        words += ["--out", tmp_path / "out"]
    process = subprocess.Popen(
        [sys.executable, "-m", "rtds_host.cli.main", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    try:
        address = re.match(r"(http://127\.0\.0\.1:\d+/)", process.stdout.readline())[1]
        if live:
            # The summary is printed once the run is written.
            while not process.stdout.readline().startswith("linear"):
                assert process.poll() is None
        with urlopen(address + "runs.json?since=") as answer:
            runs = json.load(answer)["runs"]
        assert [run["done"] for run in runs] == [True] * (1 if live else 2)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        assert (process.returncode, errors) == (0, "")
    finally:
        process.kill()
    assert not live or (tmp_path / "out" / "log.csv").is_file()


# ---- in a browser --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(browser, case):
    """The page of both runs with the diagnosis, in a browser."""
    with Viewer(Feed(recorded([case], None, case / "diagnosis.json"))) as viewer:
        browser.get_log("browser")
        browser.get(viewer.address)
        ready(browser)
        yield browser


def ready(browser):
    """Wait until a page has drawn all runs."""
    browser.set_script_timeout(60)
    browser.execute_async_script("""
        const done = arguments[0], look = () => document.querySelectorAll('canvas[data-drawn]').length
            && document.body.dataset.done === '1' ? done() : setTimeout(look, 50);
        look();""")


@pytest.mark.browser
def test_each_run_has_the_six_panels_and_no_error(page):
    assert [e for e in page.get_log("browser") if e["level"] in ("SEVERE", "WARNING")] == []
    cards = page.find_elements("css selector", ".run")
    assert [card.find_element("css selector", "h2").text.split(" ")[0] for card in cards] == ["left", "right"]
    for card in cards:
        drawn = [int(c.get_attribute("data-drawn")) for c in card.find_elements("css selector", "canvas")]
        assert len(drawn) == 6 and drawn[0] == 3 and min(drawn) > 0
    label = cards[0].find_element("css selector", "canvas").get_attribute("aria-label")
    assert label.startswith("(a) way over the floor, run left, at 3.00 s: ") and "measured" in label
    # Side by side.
    assert cards[0].rect["y"] == cards[1].rect["y"]


@pytest.mark.browser
def test_the_time_can_be_scrubbed_and_played(page):
    shot = "return document.querySelector('canvas').toDataURL()"
    scrub = page.find_element("id", "scrub")
    end = page.execute_script(shot)
    page.execute_script("arguments[0].value = 0.5; arguments[0].dispatchEvent(new Event('input'))", scrub)
    early = page.execute_script(shot)
    assert early != end and page.find_element("id", "now").text == "0.50 s"
    assert "at 0.50 s" in page.find_element("css selector", "canvas").get_attribute("aria-label")
    page.find_element("id", "play").click()
    page.execute_async_script("""
        const done = arguments[0], look = () => Number(document.getElementById('scrub').value) > 0.8
            ? done() : setTimeout(look, 20);
        look();""")
    page.find_element("id", "play").click()
    assert page.execute_script(shot) != early and page.find_element("id", "play").text == "play"
    page.find_element("css selector", "#keys input[value=nominal]").click()
    assert page.find_element("css selector", "canvas").get_attribute("data-drawn") == "2"


@pytest.mark.browser
def test_a_run_grows_on_the_page_while_it_goes_on(browser):
    plan = make_plan("linear", SHORT, Options())
    feed = Feed()
    with Viewer(feed) as viewer:
        path = LivePath(SignalPath(plan.robot.supply_v), plan, feed)
        browser.get(viewer.address)
        browser.set_script_timeout(60)
        browser.execute_async_script("""
            const done = arguments[0], look = () => document.getElementById('state').textContent
                ? done() : setTimeout(look, 20);
            look();""")
        assert browser.find_element("id", "state").text == "driving: linear"
        drive_with(plan, "model", path=path)
        path.end()
        ready(browser)
        assert browser.find_element("id", "state").text == ""
        assert browser.find_element("id", "now").text == "1.00 s"
        label = browser.find_element("css selector", "canvas").get_attribute("aria-label")
        assert "reference" in label and "measured" in label
