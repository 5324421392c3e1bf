"""A report in a real browser, from a file without a network: drawn, hovered, zoomed, saved, dark, narrow, printed."""

from __future__ import annotations

import base64
import json
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page, Source

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
if not (CHROMIUM and DRIVER):
    warnings.warn("no report is opened in a browser: apt install chromium chromium-driver", stacklevel=1)
pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="NO BROWSER TEST OF THE REPORTS: apt install chromium chromium-driver"
)
SAMPLES = 60_000  # one minute at 1 kHz
SPIKE = 41_234


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with a minute of a recording, a scatter of harmonics and a wide table."""
    time = np.arange(SAMPLES) * 0.001
    measured = np.sin(2.0 * np.pi * time)
    measured[SPIKE] = 5.0
    rest = 0.1 * np.sin(7.0 * time)
    sources = (Source("run1", "validation", 60.0, SAMPLES, 1000.0),)
    page = Page("A report", "A lead with benchmarks.discovery.foreign_study:measure", sources)
    page.heading("Curves")
    page.hint("Drag over a chart to zoom.")
    curves = (ChartSeries("measured", measured, "measured"), ChartSeries("model", measured, "after", minus=rest))
    panels = (
        Panel("y [m]", time, curves),
        Panel("residual [m]", time, (ChartSeries("rest", rest, "after"),), height=110),
    )
    page.chart(Chart("run1", "time [s]", panels, "A minute", view=(10.0, 12.0)))
    orders = np.arange(1.0, 6.0)
    dots = (ChartSeries("measured", 10.0 / orders**3, "measured", kind="rings"),)
    page.chart(Chart("harmonics", "harmonic", (Panel("[m/s²]", orders, dots, log=True),), "Harmonics"))
    page.heading("A wide table")
    page.table([f"column {k}" for k in range(15)], [[f"{k}.25 %" for k in range(15)] for _ in range(3)])
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page.render(), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = str(CHROMIUM)
    profile = tmp_path_factory.mktemp("profile")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options, Service(str(DRIVER)))
    driver.set_page_load_timeout(60)
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser: Any, report: Path) -> Any:
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    browser.set_window_size(1400, 1000)
    browser.get(report.as_uri())
    return browser


def scales(browser: Any) -> list[list[float]]:
    found = browser.execute_script("return reportCharts[0].plots.map(u => [u.scales.x.min, u.scales.x.max])")
    return [[round(v, 6) for v in pair] for pair in found]


def test_it_opens_without_an_error_and_asks_for_nothing_but_itself(opened: Any, report: Path) -> None:
    assert [entry["message"] for entry in opened.get_log("browser")] == []
    events = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    asked = {e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"}
    assert {url for url in asked if url.startswith(("http", "ws", "file"))} == {report.as_uri()}
    assert scales(opened) == [[10.0, 12.0], [10.0, 12.0]]
    assert opened.execute_script("return document.querySelectorAll('canvas').length") == 3


@pytest.mark.second_tier
def test_panels_zoom_and_point_together(opened: Any) -> None:
    from selenium.webdriver import ActionChains

    over = opened.find_elements("css selector", ".u-over")
    width = over[0].size["width"]
    chain = ActionChains(opened, duration=50).move_to_element_with_offset(over[0], -width // 4, 0)
    chain.click_and_hold().move_by_offset(width // 2, 0).release().perform()
    first, second = scales(opened)
    assert first == second
    assert first == pytest.approx([10.5, 11.5], abs=0.02)
    ActionChains(opened, duration=50).move_to_element(over[0]).perform()
    at, value, model = (c.text for c in opened.find_elements("css selector", ".u-value")[:3])
    assert float(at) == pytest.approx(11.0, abs=0.02)
    assert float(value.replace("−", "-")) == pytest.approx(np.sin(2.0 * np.pi * float(at)), abs=0.05)
    assert model != "–"
    shown = opened.execute_script("return reportCharts[0].plots.map(u => u.cursor.idx)")
    assert shown[0] == shown[1]
    ActionChains(opened).double_click(over[1]).perform()
    assert scales(opened) == [[0.0, 59.999], [0.0, 59.999]]


@pytest.mark.second_tier
def test_a_spike_of_one_sample_is_seen_among_a_minute(opened: Any) -> None:
    opened.execute_script("reportCharts[0].pressed('whole')")
    program = """
        const u = reportCharts[0].plots[0], c = u.ctx.canvas, done = arguments[0];
        requestAnimationFrame(() => {
            const x = Math.round(u.valToPos(41.234, 'x', true)), y = Math.round(u.valToPos(4.0, 'y', true));
            const p = u.ctx.getImageData(x - 3, y - 2, 7, 4).data;
            done(Array.from({ length: p.length / 4 }, (_, i) => p[4 * i + 3]).some((alpha) => alpha > 60));
        });"""
    assert opened.execute_async_script(program)


@pytest.mark.second_tier
def test_the_table_that_is_saved_is_what_is_plotted(opened: Any) -> None:
    rows = opened.execute_script("return reportCharts[0].csv()").splitlines()
    assert rows[0] == "time [s],measured: y [m],model: y [m],rest: residual [m]"
    assert len(rows) == 1 + SAMPLES
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows[1 : 1 + SAMPLES : 100]])
    assert np.allclose(values[:, 1], np.sin(2.0 * np.pi * values[:, 0]), atol=2e-4)
    assert np.allclose(values[:, 1] - values[:, 2], values[:, 3], atol=1e-8)


@pytest.mark.second_tier
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_curves_have_the_colours_of_the_theme(opened: Any, scheme: str) -> None:
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    paper = opened.execute_script("return getComputedStyle(document.body).backgroundColor")
    ink = opened.execute_script("return reportCharts[0].plots[0].series[1].stroke(reportCharts[0].plots[0], 1)")
    assert (paper, ink) == {
        "light": ("rgb(255, 255, 255)", "rgb(29, 39, 51)"),
        "dark": ("rgb(20, 24, 29)", "rgb(228, 232, 237)"),
    }[scheme]
    opened.find_element("css selector", "#theme").click()
    assert opened.execute_script("return getComputedStyle(document.body).backgroundColor") != paper


@pytest.mark.second_tier
@pytest.mark.parametrize("width", [1400, 1024, 500, 360])
def test_nothing_is_wider_than_the_screen(opened: Any, width: int) -> None:
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 900}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    opened.refresh()
    assert opened.execute_script("return document.documentElement.scrollWidth") <= width
    assert opened.execute_script("return reportCharts[0].plots[0].width") > 0.5 * min(width, 1000) - 100


@pytest.mark.second_tier
def test_it_prints_on_a4_with_nothing_cut_off(opened: Any) -> None:
    # a chart takes a new size in a microtask: none runs between a script's own events, one does between the browser's
    program = """
        const done = arguments[arguments.length - 1];
        dispatchEvent(new Event('beforeprint'));
        Promise.resolve().then(() => {
          const rights = [...document.querySelectorAll('table, canvas')].map((e) => e.getBoundingClientRect().right);
          dispatchEvent(new Event('afterprint'));
          done([document.querySelector('main').clientWidth, ...rights]);
        });"""
    hint = "return document.querySelector('.hint').offsetHeight"
    assert opened.execute_script(hint) > 0
    # A4 less its margins at 96 dpi; like paper, a small screen has no scroll bar that takes from its width
    metrics = {"width": 703, "height": 1000, "deviceScaleFactor": 1, "mobile": True}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    width, *rights = opened.execute_async_script(program)
    assert max(rights) <= width + 1
    assert opened.execute_script(hint) == 0  # how to zoom is of no use on paper
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    printed = opened.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True, "printBackground": True})
    pdf = base64.b64decode(printed["data"])
    assert pdf.startswith(b"%PDF") and len(pdf) > 20_000
    assert opened.execute_script("return document.documentElement.dataset.theme") is None  # as it was before
