"""uPlot, which the reports draw with, beside Plotly: size, time to draw and time to zoom with 60 s recordings.

    python -m benchmarks.report.chart_libraries PLOTLY.js [RECORDINGS]

PLOTLY.js is dist/plotly-basic.min.js of the npm package plotly.js-basic-dist-min; nothing of it is in the repository.
Each page holds RECORDINGS recordings of 60 s at 1 kHz: velocity and acceleration measured and simulated twice, with
their residuals. Times are those of Debian's Chromium without a window, the least of three.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

from shake_ros.report.chart import Chart, ChartSeries, Panel, chart_json
from shake_ros.report.page import Page

SAMPLES, RATE = 60_000, 1000.0
ZOOMS = 5


def recording(number: int) -> Chart:
    """A chart as `charts_fit.history_chart` makes it, of noise and sines."""
    rng = np.random.default_rng(number)
    x = np.arange(SAMPLES) / RATE
    panels = []
    for label, unit, size in (("velocity", "m/s", 0.2), ("acceleration", "m/s²", 5.0)):
        measured = size * np.sin(2 * np.pi * (0.5 + 0.05 * x) * x) + 0.01 * size * rng.normal(size=SAMPLES)
        rests = [0.2 * size * np.sin(7.0 * x) + 0.01 * size * rng.normal(size=SAMPLES) for _ in range(2)]
        colours = ("before", "after")
        curves = [ChartSeries(c, measured, c, minus=r) for c, r in zip(colours, rests, strict=True)]
        left = [ChartSeries(c, r, c) for c, r in zip(colours, rests, strict=True)]
        panels.append(Panel(f"{label} [{unit}]", x, (ChartSeries("measured", measured, "measured"), *curves)))
        panels.append(Panel(f"residual [{unit}]", x, tuple(left), height=120))
    return Chart(f"run{number}", "time [s]", tuple(panels), f"run {number}")


def uplot_page(charts: list[Chart]) -> str:
    """The report's own form."""
    page = Page("uPlot", "")
    for chart in charts:
        page.chart(chart)
    return page.render()


def plotly_page(charts: list[Chart], script: str) -> str:
    """The same curves with Plotly, one plot of four linked rows a recording, the columns packed as in the report."""
    specs = json.dumps([chart_json(chart) for chart in charts])
    program = """
const unpack = (c) => {
  if (Array.isArray(c)) return c;
  if ("count" in c) return Float64Array.from({ length: c.count }, (_, i) => c.start + i * c.step);
  const b = Uint8Array.from(atob(c.data), (x) => x.charCodeAt(0)), v = new DataView(b.buffer);
  return Float64Array.from({ length: b.length / 2 }, (_, i) => c.low + (v.getInt16(2 * i, true) + 32767) * c.step);
};
window.plots = specs.map((spec) => {
  const columns = spec.columns.map(unpack), place = document.body.appendChild(document.createElement("div"));
  const traces = spec.panels.flatMap((p, k) => p.series.map((s) => ({
    x: columns[p.x], name: s.label, mode: "lines", line: { width: 1 }, xaxis: "x", yaxis: k ? `y${k + 1}` : "y",
    y: s.minus == null ? columns[s.values] : columns[s.values].map((v, i) => v - columns[s.minus][i]) })));
  const rows = spec.panels.length, layout = { width: 1000, height: 800, grid: { rows, columns: 1 } };
  Plotly.newPlot(place, traces, layout);
  return place;
});
"""
    scripts = "".join(f"<script>{text}</script>" for text in (script, f"const specs={specs};{program}"))
    return f"<!doctype html><meta charset=utf-8><body>{scripts}"


ZOOM = {
    "uPlot": "reportCharts[0].zoom(arguments[0], arguments[0] + 10);",
    "Plotly": "await Plotly.relayout(plots[0], { 'xaxis.range': [arguments[0], arguments[0] + 10] });",
}


def timed(driver: webdriver.Chrome, path: Path, name: str) -> tuple[float, float]:
    """Time until all is drawn, and of a zoom to 10 s of a recording [s]."""
    began = time.perf_counter()
    driver.get(path.as_uri())
    painted = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()));"
    driver.execute_async_script(painted)
    drawn = time.perf_counter() - began
    # what is drawn later in the same turn, as uPlot does, counts as well
    later = "await new Promise((done) => setTimeout(done, 0));"
    program = f"const t = performance.now(); {ZOOM[name]} {later} return performance.now() - t;"
    zooms = [driver.execute_script(f"return (async () => {{ {program} }})()", 2.0 * k) for k in range(ZOOMS)]
    return drawn, 1e-3 * float(np.median(zooms))


def main(arguments: list[str] | None = None) -> None:
    """Measure both and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plotly", type=Path, metavar="PLOTLY.js", help="plotly-basic.min.js")
    parser.add_argument("recordings", type=int, nargs="*", default=[1, 2, 4], help="numbers of recordings")
    given = parser.parse_args(arguments)
    script, counts = given.plotly.read_text(encoding="utf-8"), given.recordings
    options = Options()
    options.binary_location = "/usr/bin/chromium"
    for option in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000"):
        options.add_argument(option)
    driver = webdriver.Chrome(options, Service("/usr/bin/chromedriver"))
    print(f"{'library':<10}{'recordings of 60 s':>20}{'page [MB]':>12}{'drawn in [s]':>14}{'zoom [ms]':>12}")
    with tempfile.TemporaryDirectory() as folder:
        for count in counts:
            charts = [recording(k) for k in range(count)]
            for name, page in (("uPlot", uplot_page(charts)), ("Plotly", plotly_page(charts, script))):
                path = Path(folder) / f"{name}.html"
                path.write_text(page, encoding="utf-8")
                drawn, zoom = np.min([timed(driver, path, name) for _ in range(3)], axis=0)
                size = path.stat().st_size / 1e6
                print(f"{name:<10}{count:>20}{size:>12.2f}{drawn:>14.2f}{1e3 * zoom:>12.1f}", flush=True)
    driver.quit()


if __name__ == "__main__":
    main()
