"""The documentation as a site: it works opened as files and over http, its search included, and asks no other host."""

from __future__ import annotations

import functools
import http.server
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site."""
    folder = tmp_path_factory.mktemp("docs") / "site"
    done = subprocess.run(
        [f"{sys.prefix}/bin/mkdocs", "build", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def served(site):
    """Its address over http, on this machine alone."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(site))
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def browser():
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,900"):
        options.add_argument(argument)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()


def test_no_page_asks_another_host_for_anything(site):
    for page in site.rglob("*.html"):
        loads = re.findall(r"<(?:script|link|img|iframe)[^>]*?(?:src|href)=\"?(https?://[^\s\">]+)", page.read_text())
        assert not loads, (page.name, loads)


@pytest.mark.browser
@pytest.mark.parametrize("way", ["file", "http"])
def test_the_search_finds_a_page_that_opens(way, site, served, browser):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    browser.get((site / "index.html").as_uri() if way == "file" else f"{served}/index.html")
    browser.execute_script("document.querySelector('#__search').click()")
    browser.find_element(By.CSS_SELECTOR, "input.md-search__input").send_keys("backlash")
    results = WebDriverWait(browser, 30).until(lambda b: b.find_elements(By.CSS_SELECTOR, ".md-search-result__item a"))
    address = next(a for r in results if "glossary.html" in (a := r.get_attribute("href")))
    browser.get(address)
    assert browser.find_element(By.CSS_SELECTOR, "h1").text.startswith("Glossary")


@pytest.mark.browser
def test_pictures_are_drawn_from_a_folder(site, browser):
    from selenium.webdriver.common.by import By

    browser.get((site / "index.html").as_uri())
    widths = [
        browser.execute_script("return arguments[0].naturalWidth", picture)
        for picture in browser.find_elements(By.CSS_SELECTOR, "article img")
    ]
    assert widths and all(width > 100 for width in widths)
