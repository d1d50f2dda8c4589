"""Pictures of the report and of the live view for the docs: `python python/tests/view/pictures.py`.

Drawn by the tests' browser from the tests' example case, so that they show what the tests look at: the report of each
verdict in light colours, one in dark, one 390 px wide, and the live view. They go into docs/images.
"""

from __future__ import annotations

import base64
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1] / "diagnosis"), str(HERE.parents[1])]

from diagnosis_cases import example_details, example_of  # noqa: E402
from selenium import webdriver  # noqa: E402
from test_report import account, emulate  # noqa: E402

from rtds_host.diagnosis.replay.model import nominal_model  # noqa: E402
from rtds_host.diagnosis.report import report_page  # noqa: E402
from rtds_host.view import Feed, Viewer, lines_of_run  # noqa: E402

IMAGES = HERE.parents[3] / "docs" / "images"
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
]
# Bytes of a picture, at most.
LARGEST = 150 * 1024


def shoot(browser: webdriver.Chrome, name: str, width: int, height: int) -> None:
    """Write the top of the page that is open as docs/images/NAME.png."""
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 0.75 if width > 500 else 1.0}
    shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})
    data = base64.b64decode(shot["data"])
    if len(data) > LARGEST:
        raise SystemExit(f"{name}.png: {len(data)} bytes, at most {LARGEST} are allowed")
    (IMAGES / f"{name}.png").write_bytes(data)
    print(f"{name}.png: {len(data) // 1024} KiB")


def main() -> None:
    """Make all pictures."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in FLAGS:
        options.add_argument(flag)
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    details = example_details()
    screens = [
        ("none", "light", 1100),
        ("known", "light", 1100),
        ("partial", "light", 1100),
        ("unknown", "light", 1100),
    ]
    screens += [("partial", "dark", 1100), ("partial", "light", 390)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            for verdict, scheme, width in screens:
                diagnosis = account() if verdict == "partial" else example_of(verdict)
                file = Path(folder) / "report.html"
                file.write_text(report_page(diagnosis, details), encoding="utf-8")
                emulate(browser, width, 900, scheme=scheme)
                browser.get(file.as_uri())
                kind = "" if scheme == "light" else "-dark"
                shoot(browser, f"report-{verdict}{kind}{'-narrow' if width < 500 else ''}", width, 900)
        case = details.case
        truth = nominal_model(case.robot)
        truth.add("coulomb", 0.048)
        with Viewer(Feed([lines_of_run(run, case.robot, truth) for run in case.runs[1:]])) as viewer:
            emulate(browser, 1300, 1000)
            browser.get(viewer.address)
            browser.set_script_timeout(60)
            browser.execute_async_script(
                "const d = arguments[0], look = () => document.body.dataset.done === '1' ? d() : "
                "setTimeout(look, 50); look();"
            )
            shoot(browser, "live-view", 1300, 900)
    finally:
        browser.quit()


if __name__ == "__main__":
    main()
