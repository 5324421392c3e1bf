"""The laboratory by mouse and keyboard, in a real browser: run, trip, record, learn, follow, release."""

from __future__ import annotations

import os
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from lab_process import Started, children

from benchmarks.page.browser import CHROMIUM, DRIVER, Operator, chromium
from benchmarks.page.by_mouse import next_recording, options, record, twin

if not (CHROMIUM and DRIVER):
    warnings.warn("the live page is opened in no browser: apt install chromium chromium-driver", stacklevel=1)
pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="NO BROWSER TEST OF THE LIVE PAGE: apt install chromium chromium-driver"
)
JOB = "document.querySelector('.job')?.dataset.state"  # the newest


@pytest.fixture
def operator(tmp_path: Path) -> Iterator[Operator]:
    with chromium(tmp_path / "profile", 1200, 800) as driver:
        yield Operator(driver)


def accelerogram(folder: Path) -> Path:
    """Two columns: two seconds of a swept tone [s], [m/s²]."""
    time_ = np.arange(0.0, 2.0, 0.005)
    path = folder / "shaker.csv"
    np.savetxt(path, np.c_[time_, np.sin(2 * np.pi * (2 + time_) * time_) * np.sin(np.pi * time_ / 2)], delimiter=",")
    return path


@pytest.mark.second_tier
def test_table_is_run_tripped_recorded_learned_from_and_lost_by_mouse(ros_domain, tmp_path, operator) -> None:
    with Started(*options(tmp_path)) as lab:
        operator.driver.get(lab.wait_for("open http").partition("open ")[2])
        operator.state("off")
        assert operator.see("location.search") == ""  # the token is a cookie now

        # run and record
        operator.click("#enable")
        operator.state("run")
        operator.tab("run")
        for name in ("learn", "hold"):
            record(operator, tmp_path, name, 2.5)
        assert operator.peak("position") > 0.002
        assert operator.see("document.getElementById('command').textContent") == "Ctrl-C in the recorder’s terminal"

        # another controller, a parameter, a refused one, an accelerogram
        operator.choose("[data-name=controller]", "feedforward_pi")
        operator.wait_for("the controller", lambda: "feedforward_pi" in operator.see("facts.innerText"))
        assert "param set /shake/controller controller feedforward_pi" in operator.see("command.textContent")
        operator.click("details[data-group=thd_analyzer] summary")
        operator.type("#p-thd_analyzer-orders", "500\t")
        operator.wait_for("the refusal", lambda: operator.see("document.querySelector('small.wrong')?.innerText"))
        assert "500: " in operator.find("small.wrong").text
        operator.find("#upload").send_keys(str(accelerogram(tmp_path)))
        operator.wait_for("the accelerogram", lambda: "shaker.yaml" in operator.see("facts.innerText"))

        # zoom and back
        from selenium.webdriver import ActionChains

        over = operator.find(".u-over")
        chain = ActionChains(operator.driver, duration=50).move_to_element_with_offset(over, -100, 0)
        chain.click_and_hold().move_by_offset(80, 0).release().perform()
        operator.wait_for("the zoom", lambda: operator.see("shake.curves.shownNow().zoom"))
        start, stop = operator.see("shake.curves.shownNow().zoom")
        assert 0.2 < stop - start < 5.0
        operator.click("#unzoom")
        assert operator.see("shake.curves.shownNow().zoom") is None

        # a trip on purpose, reset, and a stop with the focus in a field
        operator.click("details[data-group=plant] summary")
        operator.choose("#p-plant-faults-supply_failure", "true")
        operator.state("tripped")
        assert not operator.find("#enable").is_enabled()
        operator.tab("watch")
        operator.wait_for("the trip", lambda: "supply_pressure_low" in operator.see("trips.innerText"))
        operator.tab("run")
        operator.choose("#p-plant-faults-supply_failure", "false")
        operator.said("faults.supply_failure = False")
        operator.click("#reset")
        operator.state("off")
        operator.click("#enable")
        operator.state("run")
        note = operator.find("#record-note")
        note.send_keys("a ")
        operator.state("stopped")
        assert note.get_attribute("value") == "a"

        # learn
        operator.tab("learn")
        operator.click("[data-mark=learn][data-run=learn]")
        operator.click("[data-mark=hold][data-run=hold]")
        operator.click("#close-loop")
        operator.click("[data-cancel]")
        operator.wait_for("the cancelled job", lambda: operator.see(JOB) == "cancelled")
        operator.click("#identify")
        operator.wait_for("the job's end", lambda: operator.see(JOB) == "done")
        operator.wait_for("its report", lambda: "report.html" in operator.find("#report").get_attribute("src"))
        assert "./shake identify --learn" in operator.see("command.textContent")
        operator.click("[data-use]")
        operator.said("is used by prediction, observer, controller")
        assert "table:=" in operator.see("command.textContent")

        # the loop's process dies, then the lab ends
        os.kill(children(lab.process.pid)["graph"], signal.SIGKILL)
        operator.wait_for(
            "the alarm",
            lambda: "loop died: killed by signal 9" in operator.see("document.getElementById('alert').innerText"),
        )
        operator.state("lost")
        operator.click("[data-restart=loop]")
        operator.state("off")
        assert operator.errors() == []
        assert lab.end() == 0, lab.lines
        operator.state("disconnected")
        assert not operator.find("#stop").is_enabled()


@pytest.mark.alone  # lab, twin and browser keep two processors busy
@pytest.mark.second_tier
def test_twin_is_watched_released_and_taken_back_by_mouse(ros_domain, tmp_path, operator) -> None:
    with Started(*options(tmp_path, pace=4.0)) as lab:
        operator.driver.get(lab.wait_for("open http").partition("open ")[2])
        shown = twin(operator, tmp_path)
        assert next(shown) == "unchanged"
        operator.wait_for("a curve for each", lambda: len(operator.see("document.querySelectorAll('.uplot')")) > 8)
        assert operator.peak("twin_acceleration") == pytest.approx(operator.peak("acceleration"), rel=0.3)
        assert next(shown) == "released"
        assert "flow_coefficient × 1.0" in operator.find("#twin-release").text
        assert next(shown) == "changed"
        operator.wait_for("the change", lambda: "flow_coefficient × 0.8" in operator.find("#twin-changes").text)
        assert "→ have the spool and its null checked" in operator.find("#twin-changes").text
        assert next(shown) == "taken back"
        assert list(shown) == []
        assert operator.errors() == []
        assert lab.end() == 0, lab.lines


@pytest.mark.second_tier
@pytest.mark.alone  # the search and the graph need the processors
def test_next_recording_is_designed_released_and_decides_by_mouse(ros_domain, tmp_path, operator) -> None:
    with Started(*options(tmp_path)) as lab:
        operator.driver.get(lab.wait_for("open http").partition("open ")[2])
        shown = next_recording(operator, tmp_path)
        assert next(shown) == "asks"
        assert "next/report.html" in operator.find("#report").get_attribute("src")
        assert list(shown) == ["decided", "cancelled"]
        assert operator.errors() == []
        assert lab.end() == 0, lab.lines
