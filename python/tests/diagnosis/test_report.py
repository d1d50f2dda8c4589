"""The report: words, schema, and the page in a real headless browser."""

import io
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import example_details, example_diagnosis
from rich.console import Console

from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.report import print_summary, validate, write_report


@pytest.fixture(scope="module")
def details():
    return example_details()


# ---- diagnosis.json ------------------------------------------------------------------------------------------------

def test_the_contracts_example_is_valid():
    validate(example_diagnosis())


def _without(key):
    def edit(d):
        del d[key]
    return edit


def _with(**values):
    def edit(d):
        d.update(values)
    return edit


@pytest.mark.parametrize(("edit", "place"), [
    (_without("gap"), "gap"),
    (_with(verdict="perhaps"), "verdict"),
    (_with(schema="rtds-diagnosis/1"), "schema"),
    (_with(extra=1), "extra"),
    (_with(located=[{"subsystem": "drivetrain", "share": 0.7}]), "located"),
    (_with(located=[{"subsystem": "motor", "share": 1.0}]), "located/0/subsystem"),
    (_with(effects=[]), "effects"),
    (_with(verdict="unknown"), "effects"),
    (_with(budget=[{"what": "tolerance", "share": 0.5}]), "budget"),
    (_with(budget=[{"what": "rest", "share": 1.0}]), "budget/0"),
    (_with(verdict="partial", next_experiment=None), "next_experiment"),
    (_with(indistinguishable=[[{"id": "spin_scrub", "side": "both"}, {"id": "gyro_gain", "side": "both"}]]),
     "indistinguishable"),
    (_with(verdict="none"), "verdict"),
    (_with(alternatives=[{"effects": [], "probability": 0.4}]), "alternatives"),
    (_with(alternatives=[{"effects": [], "probability": 0.1}, {"effects": "unknown", "probability": 0.9}]),
     "alternatives"),
    (_with(indistinguishable=[[{"id": "coulomb_friction", "side": "both"}]]), "indistinguishable/0"),
    (_with(nominal_fit={"left": {}}), "nominal_fit"),
])
def test_a_diagnosis_that_breaks_the_contract_is_refused_by_place(edit, place):
    diagnosis = example_diagnosis()
    edit(diagnosis)
    with pytest.raises(ValueError, match=re.escape(place)):
        validate(diagnosis)


def test_an_interval_may_be_null_for_not_pinned():
    diagnosis = example_diagnosis()
    diagnosis["effects"][0]["parameters"]["torque_nm"]["ci90"] = None
    validate(diagnosis)


# ---- the page as text ----------------------------------------------------------------------------------------------

def test_the_same_input_gives_the_same_bytes(details, tmp_path):
    first = write_report(tmp_path / "a.html", example_diagnosis(), details)
    details.seconds = 17.0
    write_report(tmp_path / "b.html", example_diagnosis(), example_details())
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes() == first.encode()


def test_the_page_refers_to_nothing_outside_itself(details):
    text = write_report(None, example_diagnosis(), details)
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)""", text)
    assert "http://" not in text and "https://" not in text


def test_the_page_is_small_enough_to_mail(details):
    assert len(write_report(None, example_diagnosis(), details)) < 3_000_000


def test_text_from_outside_cannot_become_markup(details):
    text = write_report(None, example_diagnosis(), details)
    assert "&lt;on other runs&gt;" in text and "<on other runs>" not in text


# Names as a recording of somebody else may carry them: runs, robot, case, channels.
HOSTILE = ("</script><script>window.owned=1</script>", "<!--<script>", "]]><svg/onload=window.owned=1>",
           "\"><img src=x onerror=window.owned=1>", "' onclick='window.owned=1", "__proto__", "${window.owned=1}", "a&lt;b")


def hostile(details):
    """The details with hostile names wherever names come from outside, and a diagnosis to them."""
    names = dict(zip((run.name for run in details.case.runs), HOSTILE))
    runs = tuple(replace(run, name=names[run.name]) for run in details.case.runs)
    case = replace(details.case, name=HOSTILE[3], robot=replace(details.case.robot, name=HOSTILE[4]), runs=runs)
    first = next(iter(details.traces))
    traces = {names[run]: dict(channels) for run, channels in details.traces.items()}
    traces[names[first]].update({name: details.traces[first]["w_l"] for name in HOSTILE})
    diagnosis = example_diagnosis()
    diagnosis["held_out_runs"] = list(HOSTILE)
    gap = {"before": 14.2, "refit": 13.9, "after": 1.08}
    diagnosis["gap"]["channels"] = {name: gap for name in HOSTILE}
    return diagnosis, replace(details, case=case, traces=traces, gate=examine(case), notes=list(HOSTILE),
                              run_gaps={name: gap for name in HOSTILE}, regimes={name: gap for name in HOSTILE})


def test_no_name_can_end_a_script_or_open_a_comment_in_it(details):
    text = write_report(None, *hostile(details))
    embedded = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    assert len(embedded) == 2 and not any("<" in data for data in embedded)
    assert HOSTILE[0] in json.loads(embedded[0]) and json.loads(embedded[1])["held_out_runs"] == list(HOSTILE)


def test_escape_codes_in_names_do_not_reach_a_terminal(details):
    codes = "\x1b[2J\x1b]0;owned\x07\u202e\x9b31m\udcff"
    run = replace(details.case.runs[0], name=f"run{codes}", columns={**details.case.runs[0].columns,
                                                                   "w_l": np.zeros(len(details.case.runs[0].t))})
    case = replace(details.case, name=f"case{codes}", runs=(run, *details.case.runs[1:]))
    console = Console(file=io.StringIO(), width=400, force_terminal=False)
    print_summary(console, example_diagnosis(), replace(details, case=case, gate=examine(case)))
    shown = console.file.getvalue()
    assert shown.isascii() or not any(ord(c) in range(0x7F, 0xA0) or c in "\u202e\udcff" for c in shown)
    assert "\x1b" not in shown and r"case\x1b[2J\x1b]0;owned\x07\u202e\x9b31m\udcff" in shown
    assert r"run\x1b[2J" in shown


@pytest.mark.parametrize("verdict", ["none", "partial", "unknown"])
def test_every_verdict_has_its_page_and_summary(details, verdict):
    diagnosis = example_diagnosis()
    diagnosis["verdict"] = verdict
    if verdict == "none":
        diagnosis.update(effects=[], next_experiment=None, located=[], budget=[])
        diagnosis["gap"].update(closed=None, closed_ci90=None, effect_closed=None)
    else:
        diagnosis["gap"]["rest"] = {"share": 0.4, "structured": True, "subsystem": "wheel_ground"}
    if verdict == "unknown":
        diagnosis["effects"] = []
        diagnosis["budget"] = [{"what": "tolerance", "share": 0.1}, {"what": "rest", "subsystem": "drivetrain", "share": 0.9}]
    validate(diagnosis)
    text = write_report(None, diagnosis, details)
    console = Console(file=io.StringIO(), width=100)
    print_summary(console, diagnosis, details)
    shown = console.file.getvalue()
    assert verdict in shown
    if verdict == "none":
        assert "Nothing is missing" in text and "Nothing is missing" in shown
    elif verdict == "partial":
        assert "40 % of it has no name, most of that in the wheel and ground" in text and "Coulomb friction" in shown
    else:
        assert "most of it lies in the wheel and ground" in text and "with the blamed effects" not in text.split("<table")[0]
        assert "no name, drivetrain 90 %" in shown


def test_the_summary_names_effect_value_gap_and_next_run(details):
    console = Console(file=io.StringIO(), width=120)
    print_summary(console, example_diagnosis(), details)
    shown = console.file.getvalue()
    for piece in ("Coulomb friction, both sides", "0.048 N·m (0.046 to 0.05)", "14.2", "1.08", "rtds run crawl"):
        assert piece in shown
    assert len(shown.splitlines()) < 20


# ---- the page in a browser -----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
                 "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-dev-shm-usage",
                 "--window-size=1200,1400", f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def opened(browser, details, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, example_diagnosis(), details)
    browser.get_log("performance")
    browser.get(path.as_uri())
    return browser


@pytest.mark.browser
def test_hostile_names_are_shown_and_do_nothing(browser, details, tmp_path):
    diagnosis, marked = hostile(details)
    write_report(tmp_path / "report.html", diagnosis, marked)
    browser.get_log("browser")
    browser.get((tmp_path / "report.html").as_uri())
    assert [entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    assert browser.execute_script("return typeof window.owned") == "undefined"
    assert len(browser.find_elements("css selector", "script")) == 3
    assert browser.find_elements("css selector", "img, [onclick], [onload], [onerror]") == []
    held = json.loads(browser.execute_script("return document.getElementById('diagnosis').textContent"))
    assert held == diagnosis
    assert HOSTILE[3] in browser.find_element("css selector", "h1").text
    runs = [option.get_attribute("value") for option in browser.find_elements("css selector", "#run option")]
    assert runs == list(HOSTILE[:3])
    drawn = browser.find_elements("css selector", "#plots canvas")
    assert {c.get_attribute("data-channel") for c in drawn} >= {"w_l", *HOSTILE}


PIXELS = """
const c = arguments[0], d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = new Set();
for (let k = 0; k < d.length; k += 4) if (d[k + 3] > 200) seen.add(d[k] + ',' + d[k + 1] + ',' + d[k + 2]);
return [...seen];
"""


@pytest.mark.browser
def test_the_page_loads_without_errors_and_without_network(opened):
    assert [entry for entry in opened.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    asked = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [m["params"] for m in asked if m["method"] == "Network.requestWillBeSent"]
    # The browser's own start page may still be loading; what counts is what the report asks for.
    urls = [p["request"]["url"] for p in sent if p["documentURL"] == opened.current_url]
    assert opened.current_url in urls
    assert [url for url in urls if not url.startswith(("file:", "data:"))] == []


@pytest.mark.browser
def test_the_text_on_the_page_matches_the_json(opened):
    held = json.loads(opened.execute_script("return document.getElementById('diagnosis').textContent"))
    assert held == example_diagnosis()
    verdict = opened.find_element("id", "verdict").text
    for piece in ("known", "Coulomb friction, both sides", "0.048 N·m", "96 %", "13.9", "1.08"):
        assert piece in verdict
    figures = {f.get_attribute("data-name"): f.text for f in opened.find_elements("css selector", "#gap > div")}
    assert figures["before"].startswith("14.2") and figures["after"].startswith("1.08")
    assert "99.1 % to 99.7 %" in figures["closed"]
    shares = {g.get_attribute("data-subsystem"): float(g.get_attribute("data-share"))
              for g in opened.find_elements("css selector", "#chain .block")}
    assert shares["drivetrain"] == 0.91 and shares["driver"] == 0.09 and len(shares) == 7
    rows = opened.find_elements("css selector", "#alternatives tbody tr")
    assert [float(r.get_attribute("data-probability")) for r in rows] == [0.95, 0.03, 0.01, 0.01]
    assert "misses the runs with payload" in rows[1].text
    assert "0.046 to 0.05" in opened.find_element("css selector", "#effects tr.effect").text
    assert "w_l" in opened.find_element("id", "channels").text
    assert "crawl" in opened.find_element("id", "next").text


@pytest.mark.browser
def test_each_channel_has_a_plot_with_measured_nominal_and_after(opened):
    canvases = opened.find_elements("css selector", "#plots canvas")
    assert {c.get_attribute("data-channel") for c in canvases} >= {"w_l", "w_r", "i_l", "gyro_z", "yaw"}
    chosen = next(c for c in canvases if c.get_attribute("data-channel") == "w_l")
    colours = opened.execute_script(PIXELS, chosen)
    for line in ("217,119,6", "21,128,61"):
        assert line in colours


@pytest.mark.browser
def test_the_wheel_zooms_all_plots_and_the_button_shows_the_whole_run(opened):
    shot = "return document.querySelector('#plots canvas').toDataURL()"
    before = opened.execute_script(shot)
    opened.execute_script("""
        const c = document.querySelector('#plots canvas'), b = c.getBoundingClientRect();
        c.dispatchEvent(new WheelEvent('wheel', {deltaY: -800, clientX: b.left + b.width / 2, clientY: b.top + 50,
                                                 bubbles: true, cancelable: true}));""")
    zoomed = opened.execute_script(shot)
    assert zoomed != before
    opened.execute_script("document.getElementById('reset').click()")
    assert opened.execute_script(shot) == before


@pytest.mark.browser
def test_another_run_and_another_line_can_be_shown(opened):
    shot = "return document.querySelector('#plots canvas[data-channel=w_l]').toDataURL()"
    first = opened.execute_script(shot)
    opened.execute_script("const s = document.getElementById('run'); s.value = 'weave'; "
                          "s.dispatchEvent(new Event('change'))")
    second = opened.execute_script(shot)
    assert second != first
    opened.execute_script("document.querySelector('#keys input[value=nominal]').click()")
    assert opened.execute_script(shot) != second
