"""Every page by an automatic checker (axe-core, which comes with a package): no serious finding."""

import importlib.util
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "diagnosis"))

from diagnosis_cases import example_details, example_diagnosis, example_of
from test_report import account, emulate

from rtds_host.diagnosis.differ import compare
from rtds_host.diagnosis.differ import page as differing
from rtds_host.diagnosis.overview import overview_page, row_of
from rtds_host.diagnosis.report import report_page
from rtds_host.diagnosis.report.made import written
from rtds_host.view import Feed, Lines, Viewer

AXE = Path(importlib.util.find_spec("axe_core_python").origin).with_name("axe.min.js")
SCREENS = [("light", 1280), ("dark", 1280), ("light", 390), ("dark", 390)]
CHECK = """
const done = arguments[0];
axe.run(document, {resultTypes: ['violations']}).then(r => done(r.violations
  .filter(v => v.impact === 'serious' || v.impact === 'critical')
  .map(v => v.id + ': ' + v.nodes.map(n => n.html.slice(0, 120)).join(' | '))), e => done([String(e)]));
"""


def findings(browser):
    """What axe finds serious or critical on the page that is open."""
    browser.set_script_timeout(120)
    browser.execute_cdp_cmd("Page.setBypassCSP", {"enabled": True})
    browser.execute_script(AXE.read_text(encoding="utf-8"))
    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    return browser.execute_async_script(CHECK)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Name -> file of every page that is written."""
    place, details = tmp_path_factory.mktemp("pages"), example_details()
    texts = {verdict: report_page(example_of(verdict), details) for verdict in ("none", "known", "unknown")}
    texts["partial"] = written(report_page(account(), details), place / "case", place / "out", quick=False)
    rows = [row_of("a", example_diagnosis(), 2.5), row_of("b", account(), 2.5), row_of("c", None, None, "c: missing")]
    texts |= {"overview": overview_page(rows), "diff": differing(compare(example_diagnosis(), account()), ("a", "b"))}
    for name, text in texts.items():
        (place / f"{name}.html").write_text(text, encoding="utf-8")
    return place


@pytest.fixture
def screen(browser):
    """Give the browser a screen; afterwards it has its own again."""
    yield lambda scheme, width: emulate(browser, width, 900, scheme=scheme)
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


@pytest.mark.browser
@pytest.mark.parametrize("name", ["none", "known", "partial", "unknown", "overview", "diff"])
def test_no_page_has_a_serious_finding(browser, screen, pages, name):
    found = {}
    for scheme, width in SCREENS:
        screen(scheme, width)
        browser.get((pages / f"{name}.html").as_uri())
        found[scheme, width] = findings(browser)
    assert found == dict.fromkeys(SCREENS, [])


@pytest.mark.browser
def test_the_live_view_has_no_serious_finding(browser, screen):
    columns = {name: [0.0, 1.0] for name in ("t", "x", "y", "yaw", "w_l", "w_r", "i_l", "i_r", "v_cmd_l", "v_cmd_r")}
    with Viewer(Feed([Lines("run", "robot", {"measured": columns})])) as viewer:
        found = {}
        for scheme, width in SCREENS:
            screen(scheme, width)
            browser.get(viewer.address)
            found[scheme, width] = findings(browser)
    assert found == dict.fromkeys(SCREENS, [])


@pytest.mark.browser
def test_the_checker_finds_what_is_wrong(browser, tmp_path):
    (tmp_path / "bad.html").write_text('<html lang="en"><title>x</title><button></button><p style="color:#ccc">faint')
    browser.get((tmp_path / "bad.html").as_uri())
    assert {text.split(":")[0] for text in findings(browser)} >= {"button-name", "color-contrast"}
