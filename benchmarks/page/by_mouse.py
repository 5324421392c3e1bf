"""The next recording, and the twin with its release, by mouse alone, as an operator does both in a browser.

    python -m benchmarks.page.by_mouse next_recording|twin --pictures FOLDER

`./shake lab --lockstep` runs the simulated table. `next_recording`: two short motions are recorded, which leave most
effects open; *Decide* designs the motion that shows them, the operator releases it, and the search goes on. `twin`: the
twin follows the table, its values are released to the closed loop; the valve gives less flow (amber), and they are
taken back. `--pictures`: of the page in each state.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import yaml

from benchmarks import ROOT
from benchmarks.page.browser import Operator, chromium
from benchmarks.realtime.page_soak import SHAKE, laboratory
from shake_ros.settings import find, load_table, read_yaml

WIDTH, HEIGHT = 1200, 1150  # of a picture [pixels]
TIMEOUT = 600.0  # for any step, on a busy machine [s]
SECONDS = 2.0  # of each of the two recordings [s]
JOB = "shake.state.status.jobs.at(-1)"
TWIN = """{window: 1.0, reference: 5.0, false_alarms: 0.01, naming: 3.0, matters: 0.02, parameters: {
  valve.flow_coefficient: {file: 0.1, walk: 0.01}, bulk_modulus.modulus: {file: 0.1, walk: 0.1}}}"""
FLOW, LESS_FLOW = "valve.flow_coefficient", 0.85  # the fault [-]


def quick_interlock(folder: Path) -> Path:
    """As on the real table, but at low and high pressure for a tenth of a second."""
    settings = read_yaml(find("interlock", "bergamo"))
    path = folder / "quick.yaml"
    path.write_text(yaml.safe_dump({**settings, "low_pressure_time": 0.1, "high_pressure_time": 0.1}))
    return path


def options(folder: Path, pace: float = 1.0) -> list[str]:
    """Arguments of a lab in lock-step, at most so many times as fast as the clock."""
    own = ["--reference", "multisine", "--interlock", str(quick_interlock(folder)), "--pace", f"{pace:g}"]
    return ["--lockstep", "--composed", "--port", "0", "--folder", str(folder), *own]


def record(operator: Operator, folder: Path, name: str, seconds: float) -> None:
    """Play and record so many seconds of the reference."""
    operator.type("#record-name", name)
    operator.click("#record")
    operator.said(f"recording to {folder}/recordings/{name}")
    operator.wait_for("the red dot", lambda: operator.see("!!document.querySelector('.rec')"))
    operator.click("#play")
    operator.pass_time(seconds)
    operator.click("#rest")
    operator.click("#unrecord")
    operator.said(f"recording closed: {folder}/recordings/{name}")


def next_recording(operator: Operator, folder: Path) -> Iterator[str]:
    """Two recordings, and a third that is designed, released and played; the search for a fourth is cancelled.

    Yields "asks" before the table may move, "decided" once the search has gone on, and "cancelled".
    """
    operator.state("off")
    operator.click("#enable")
    operator.state("run")
    operator.tab("run")
    for name in ("first", "second"):
        record(operator, folder, name, SECONDS)
    operator.tab("learn")
    operator.click("[data-mark=learn][data-run=first]")
    operator.click("[data-mark=hold][data-run=second]")
    operator.click("#decide")
    operator.said("started: ./shake close_loop")
    operator.wait_for("a design", lambda: operator.see(f"{JOB}?.asks || ({JOB} && {JOB}.state !== 'running')"))
    operator.wait_for("its page", lambda: "next/report.html" in (operator.see("report.src") or ""))
    yield "asks"
    operator.click("[data-release=true]")
    operator.said("released by the operator")
    operator.wait_for("the decision", lambda: "decided/report.html" in operator.see("report.src"))
    yield "decided"
    operator.click("[data-cancel]")
    operator.wait_for("the job's end", lambda: operator.see(f"{JOB}.state") == "cancelled")
    yield "cancelled"


@contextmanager
def beside(folder: Path) -> Iterator[None]:
    """A twin of the declared table, in a process of its own."""
    settings = folder / "twin.yaml"
    settings.write_text(TWIN, encoding="utf-8")
    own = ["-p", "table:=bergamo", "-p", f"settings:={settings}", "-p", "lockstep:=true", "-p", "release_time:=0.5"]
    with (folder / "twin.log").open("w", encoding="utf-8") as log:
        process = subprocess.Popen([*SHAKE, "twin", "--ros-args", *own], cwd=ROOT, stdout=log, stderr=log)
        try:
            yield
        finally:
            process.terminate()
            process.wait(60.0)


def twin(operator: Operator, folder: Path) -> Iterator[str]:
    """A twin beside the table, its release, and a fault.

    Yields the light as it changes, "released" and "taken back".
    """
    operator.state("off")
    operator.click("#enable")
    operator.state("run")
    with beside(folder):
        operator.tab("run")
        operator.click("#repeat")
        operator.click("#play")
        operator.click("details[data-group=plant] summary")
        operator.tab("watch")
        yield light(operator, "unchanged")
        operator.click("#release")
        yield released(operator, "released")
        change(operator, FLOW, LESS_FLOW * load_table("bergamo").value(FLOW))
        yield light(operator, "changed")
        operator.click("#release")
        yield released(operator, "taken back")


def light(operator: Operator, word: str) -> str:
    """Wait for the twin's light."""
    operator.wait_for(f"the twin's light: {word}", lambda: operator.find("#twin-light").text == word)
    return word


def released(operator: Operator, word: str) -> str:
    """Wait for the state of the twin's release."""
    operator.wait_for(word, lambda: word in operator.find("#twin-release").text)
    return word


def change(operator: Operator, name: str, value: float) -> None:
    """Change a number of the simulated table."""
    operator.tab("run")
    operator.type(f"#p-plant-{name.replace('.', '-')}", f"{value:g}\t")
    operator.said(f"{name} = ")
    operator.tab("watch")


DONE: Mapping[str, Callable[[Operator, Path], Iterator[str]]] = {"next_recording": next_recording, "twin": twin}
PACE = {"next_recording": 1.0, "twin": 4.0}  # the search needs a processor, the twin much motion
SHOWN = {"next_recording": "#work", "twin": "#twin-light"}  # what is on top of a picture


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("what", choices=DONE)
    parser.add_argument("--pictures", type=Path, required=True, metavar="FOLDER")
    given = parser.parse_args()
    given.pictures.mkdir(parents=True, exist_ok=True)
    begun, domain = time.monotonic(), int(os.environ.get("ROS_DOMAIN_ID", "0"))
    with tempfile.TemporaryDirectory(prefix="by_mouse-") as name:
        folder = Path(name)
        words = options(folder, PACE[given.what])
        with laboratory(words, domain) as lab, chromium(folder / "profile", WIDTH, HEIGHT) as driver:
            driver.get(lab.waits_for("open http", TIMEOUT).partition("open ")[2])
            operator = Operator(driver, TIMEOUT)
            for number, state in enumerate(DONE[given.what](operator, folder), 1):
                print(f"{time.monotonic() - begun:6.0f} s  {state}", flush=True)
                time.sleep(3.0)  # until what the page shows is drawn
                driver.execute_script(f"document.querySelector('{SHOWN[given.what]}').scrollIntoView()")
                driver.save_screenshot(str(given.pictures / f"{given.what}_{number}.png"))
            print(f"errors in the browser's console: {'; '.join(operator.errors()) or 'none'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
