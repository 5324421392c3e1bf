"""From nothing to a closed loop with a mouse alone, as somebody does it the first time: how long each step takes.

    python -m benchmarks.page.first_loop [--clone] [--table bergamo_measured] [--pictures FOLDER] [--save] [-- LAB …]

`./shake lab --lockstep` runs a table that has more in it than the declared one. Then by clicks in Chromium: enable,
play and record what the fit learns from, play and record what it is held against, repair the model, read its report,
use the found table, play the second motion again; the tracking before and after stands in *Runs*. `--clone`: in a
clone of this repository, set-up and first compilation included; otherwise by this interpreter. `LAB …`: more
arguments of `lab`.

`--pictures`: of the page after each step. The last figures are in first_loop.txt.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import ROOT
from benchmarks.page.browser import Operator, chromium
from benchmarks.realtime.page_soak import SHAKE, laboratory

SAVED = Path(__file__).with_suffix(".txt")
DECLARED = "bergamo"  # table of which the operator knows
LEARN, HOLD = "demo_excitation", "earthquake"  # what is played for the fit and against it
TIMEOUT = 420.0  # for any step, on a busy machine [s]
WANTED = 600.0  # the whole [s]
JOB = "document.querySelector('.job')?.dataset"


class Steps:
    """Takes the time of each step, and its picture where they are wanted."""

    def __init__(self, operator: Operator | None, pictures: Path | None) -> None:
        self.operator, self._pictures = operator, pictures
        self.begun = self._before = time.monotonic()
        self.rows: list[tuple[str, float, int]] = []
        self._clicks = 0

    def done(self, what: str, picture: str = "") -> None:
        """A step has come to its end."""
        now, clicks = time.monotonic(), self.operator.clicks if self.operator else 0
        self.rows.append((what, now - self._before, clicks - self._clicks))
        print(f"{now - self.begun:7.0f} s  {what}: {now - self._before:.0f} s", flush=True)
        if picture and self._pictures and self.operator:
            self._pictures.mkdir(parents=True, exist_ok=True)
            time.sleep(1.0)
            self.operator.driver.save_screenshot(str(self._pictures / f"{picture}.png"))
        self._before, self._clicks = time.monotonic(), clicks


def play_and_record(operator: Operator, reference: str, name: str) -> None:
    """One motion from its start to its end, in a recording of its own."""
    operator.tab("run")
    operator.choose("[data-name=reference]", reference)
    operator.wait_for("the reference", lambda: reference in operator.see("facts.innerText"))
    runs = operator.see("shake.state.status.runs.length")
    operator.type("#record-name", name)
    operator.click("#record")
    operator.wait_for("the red dot", lambda: operator.see("!!document.querySelector('.rec')"))
    operator.click("#play")
    operator.wait_for("the end of the run", lambda: operator.see("shake.state.status.runs.length") > runs)
    operator.click("#unrecord")
    operator.said(f"recordings/{name}")


def last_run(operator: Operator) -> dict[str, Any]:
    """As *Runs* shows it."""
    found: dict[str, Any] = operator.see("shake.state.status.runs.at(-1)")
    return found


def read_report(operator: Operator) -> str:
    """The first sentence of the report that the page shows."""
    frame = operator.find("#report")
    operator.driver.switch_to.frame(frame)
    try:
        said = operator.driver.find_element("css selector", "main p, main li, p").text
    finally:
        operator.driver.switch_to.default_content()
    return " ".join(str(said).split())


def work(operator: Operator, steps: Steps) -> list[str]:
    """The loop by mouse; what it has found and brought."""
    operator.state("off")
    steps.done("page open, table off", "1_off")
    operator.click("#enable")
    operator.state("run")
    steps.done("enabled, through low and high pressure", "2_run")
    play_and_record(operator, LEARN, "learn")
    steps.done(f"{LEARN} played and recorded", "3_learn")
    play_and_record(operator, HOLD, "hold")
    before = last_run(operator)
    steps.done(f"{HOLD} played and recorded", "4_hold")
    operator.tab("learn")
    operator.click("[data-mark=learn][data-run=learn]")
    operator.click("[data-mark=hold][data-run=hold]")
    operator.click("#close-loop")
    operator.wait_for("the job", lambda: operator.see(f"{JOB}?.state") == "running")
    steps.done("recordings marked, loop being closed", "5_marked")
    operator.wait_for("the job's end", lambda: operator.see(f"{JOB}?.state") != "running")
    state = operator.see(f"{JOB}.state")
    if state != "done":
        raise RuntimeError(f"close_loop {state}: {operator.find('#work').text}")
    operator.wait_for("its report", lambda: "report.html" in (operator.find("#report").get_attribute("src") or ""))
    time.sleep(2.0)
    said = read_report(operator)
    steps.done("loop closed, report open", "6_report")
    operator.click("[data-use]")
    operator.said("is used by")
    steps.done("found table loaded", "7_loaded")
    operator.tab("run")
    runs = operator.see("shake.state.status.runs.length")
    operator.click("#play")
    operator.wait_for("the end of the run", lambda: operator.see("shake.state.status.runs.length") > runs)
    after = last_run(operator)
    operator.tab("watch")
    steps.done(f"{HOLD} played again", "8_after")
    return [
        f"report: {said}",
        f"tracking of {HOLD}: {1e3 * before['error_rms']:.3f} → {1e3 * after['error_rms']:.3f} mm rms "
        f"({100 * before['error_relative']:.2f} → {100 * after['error_relative']:.2f} %)",
    ]


def text(command: str, steps: Steps, found: list[str], errors: list[str], load: float) -> str:
    """As printed and saved."""
    said = [f"{command}   ({os.cpu_count()} cores, load {load:.1f} before)", "", f"{'step':45}{'s':>8}{'clicks':>8}"]
    said += [f"{what:45}{seconds:8.0f}{clicks:8}" for what, seconds, clicks in steps.rows]
    whole = sum(seconds for _, seconds, _ in steps.rows)
    clicks = sum(clicks for _, _, clicks in steps.rows)
    said += [f"{'whole':45}{whole:8.0f}{clicks:8}   (wanted: < {WANTED:.0f} s)", "", *found]
    said.append(f"errors in the browser's console: {'; '.join(errors) or 'none'}")
    return "\n".join(said) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--clone", action="store_true", help="in a fresh clone, with an empty cache")
    parser.add_argument("--table", default="bergamo_measured", help="that is simulated (default: %(default)s)")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER")
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name} as well")
    parser.add_argument("lab", nargs="*", metavar="LAB", help="more arguments of lab, after --")
    given = parser.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="first_loop-") as name:
        folder = Path(name)
        steps = Steps(None, given.pictures and given.pictures.absolute())
        where, program = ROOT, SHAKE
        if given.clone:
            where, program = folder / "shake_ros", ("./shake",)
            os.environ |= {"XDG_CACHE_HOME": str(folder / "cache"), "NUMBA_CACHE_DIR": str(folder / "cache" / "numba")}
            os.environ.pop("PYTHONPATH", None)
            subprocess.run(["git", "clone", "--quiet", "--local", str(ROOT), str(where)], check=True)
            steps.done("cloned")
        options = [
            "--lockstep",
            "--table",
            given.table,
            "--model",
            DECLARED,
            "--port",
            "0",
            "--folder",
            str(folder / "lab"),
            *given.lab,
        ]
        domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
        with laboratory(options, domain, program, where) as lab, chromium(folder / "profile") as driver:
            address = lab.waits_for("open http", TIMEOUT).partition("open ")[2]
            steps.done("./shake lab, set-up included: address" if given.clone else "lab: address")
            driver.get(address)
            operator = steps.operator = Operator(driver, TIMEOUT)
            found = work(operator, steps)
            errors = operator.errors()
    found.append(f"Ctrl-C: {lab.lines[-1]}")
    own = ["--clone"] * given.clone + ["--table", given.table] * (given.table != parser.get_default("table"))
    words = ["python -m benchmarks.page.first_loop", *own, *(["--", *given.lab] if given.lab else [])]
    told = text(" ".join(words), steps, found, errors, load)
    print(told, end="")
    if given.save:
        SAVED.write_text(told, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
