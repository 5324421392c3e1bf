"""Commissioning: each step is released, the limits grow with it, what it leaves loads, and a hold ends it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from live_tables import SimulatedLiveTable, acting
from short_tuning import short_tuning

import shake_ros as sr
from shake_ros.__main__ import main
from shake_ros.commissioning.commission import Commission
from shake_ros.commissioning.steps import HELD, interlock_of, load_commission
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.reference.motion import Envelope
from shake_ros.experiment_design.next_recording import NextRecording
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording
from shake_ros.recordings.reference_file import build_program
from shake_ros.safety.causes import InterlockParameters
from shake_ros.settings import config_folder, load_interlock, load_table, load_variant

SOFT = {"bulk_modulus.modulus": 7e8}


def settings(folder: Path, **changes: object) -> str:
    """The default way, shortened."""
    content = yaml.safe_load((config_folder() / "commission.yaml").read_text(encoding="utf-8"))
    content |= {"seconds": 4.0, "levels": [0.5], "laws": ["three_variable"], "search_from": 2.0}
    content["tuning"] = short_tuning(folder, 2)
    numbers = content["numbers"] | {k: v for k, v in changes.items() if k in content["numbers"]}
    content |= {k: v for k, v in changes.items() if k in content} | {"numbers": numbers}
    path = folder / "way.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def way(tmp_path_factory: pytest.TempPathFactory) -> tuple[Commission, list[str], Path]:
    folder = tmp_path_factory.mktemp("commission")
    said: list[str] = []

    def release(text: str) -> bool:
        said.append(text)
        return True

    found = sr.commission("bergamo", set=SOFT, settings=settings(folder), release=release, progress=False)
    return found, said, found.report(folder / "out")


def test_gains_of_the_first_level_follow_better_than_the_first_loop(way: tuple[Commission, list[str], Path]) -> None:
    found, said, _ = way
    assert found.complete
    assert len(said) == len(found.steps) == 2
    assert "6.0 mm from the reference" in said[0]
    first, last = (step.error for step in found.steps)
    assert first and last
    assert last[1] < 0.3 * first[1]
    assert last[2] < 0.15
    tuned = found.tuned
    assert tuned is not None
    assert tuned.table.value("bulk_modulus.modulus") == pytest.approx(7e8, rel=0.03)


def test_what_it_leaves_is_read_by_path(way: tuple[Commission, list[str], Path]) -> None:
    found, _, out = way
    table = load_table(str(out / "table.yaml"))
    assert table.value("bulk_modulus.modulus") == pytest.approx(7e8, rel=0.03)
    assert load_variant("controller", str(out / "controller.yaml"), CONTROLLERS)[0] == "three_variable"
    assert load_variant("observer", str(out / "observer.yaml"), OBSERVERS)[0] == "model"
    limits = load_interlock(str(out / "interlock.yaml"))
    assert {name: limits.response(name).threshold for name in HELD} == dict(found.steps[-1].limits)
    assert json.loads((out / "commission.json").read_text(encoding="utf-8"))["complete"] is True
    assert len(sr.read(*sorted((out / "recordings").iterdir()))) == 2
    page = (out / "commission.html").read_text(encoding="utf-8")
    assert "Step 2, level 0.5" in page and "three_variable" in page


def test_limits_grow_with_the_level_and_stay_within_the_outermost_ones() -> None:
    own = load_commission("default")
    motion = build_program("earthquake", 0.001).samples(0, 8000)
    low, high = (
        [interlock_of(own, k * motion, own.levels[0] / k)["causes"][n]["threshold"] for n in HELD] for k in (0.1, 1.0)
    )
    outermost = [load_interlock("bergamo").response(name).threshold for name in HELD]
    assert all(a < b <= c for a, b, c in zip(low, high, outermost, strict=True))


def test_interlock_that_holds_ends_the_way_with_what_it_saw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = settings(tmp_path, margin=1.0, distance=2e-4)
    assert main(["commission", "--yes", "--config", given, "--out", str(tmp_path / "out")]) == 1
    assert "tracking_error" in capsys.readouterr().err.splitlines()[-1]
    steps = json.loads((tmp_path / "out" / "commission.json").read_text(encoding="utf-8"))["steps"]
    assert len(steps) == 1 and steps[0]["error"] is None
    assert not (tmp_path / "out" / "controller.yaml").exists()


def test_nobody_at_the_terminal_releases_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with open("/dev/null", encoding="utf-8") as nobody:
        monkeypatch.setattr("sys.stdin", nobody)
        assert main(["commission", "--out", str(tmp_path / "out")]) == 2
    assert "--yes" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_live_table_gets_each_level_s_limits_and_loop_and_is_set_back(tmp_path: Path) -> None:
    table = SimulatedLiveTable(load_table("bergamo").with_values(SOFT), tmp_path)
    said: list[str] = []

    def release(text: str) -> bool:
        said.append(text)
        return True

    found = sr.commission("bergamo", settings=settings(tmp_path), live=table, release=release, progress=False)
    assert found.complete
    assert [path.name for path in table.carried] == ["linear_bergamo.yaml", "observer.yaml"]
    low, high = (given["velocity"] for given in table.limited)
    assert low == high < table.interlock().limits["velocity"]  # one level, run twice
    assert "the pressure goes off" in said[0] and "mm from the reference" not in said[0]  # lock-step has no such cause
    first, last = (step.error for step in found.steps)
    assert first and last and last[1] < 0.3 * first[1]
    out = found.report(tmp_path / "out")
    assert load_table(str(out / "table.yaml")).value("bulk_modulus.modulus") == pytest.approx(7e8, rel=0.03)


def test_live_interlock_that_holds_ends_the_way(tmp_path: Path) -> None:
    table = SimulatedLiveTable(load_table("bergamo"), tmp_path, held_at=0.3)
    found = sr.commission("bergamo", settings=settings(tmp_path), live=table, progress=False)
    assert found.reason == "level 0.5: the interlock held: velocity 0.3 beyond 0.2 m/s"
    assert len(found.steps) == 1 and found.steps[0].error is None


def test_interlock_that_only_tells_is_no_guard(tmp_path: Path) -> None:
    table = SimulatedLiveTable(load_table("bergamo"), tmp_path)
    table.own = acting(table.own, ["position_hard"])
    with pytest.raises(ShakeError, match=r"the interlock has no action on velocity, acceleration"):
        sr.commission("bergamo", settings=settings(tmp_path), live=table, progress=False)
    with pytest.raises(ShakeError, match=r"set bulk_modulus.modulus: values of the simulated table"):
        sr.commission("bergamo", set=SOFT, settings=settings(tmp_path), live=table, progress=False)


def test_levels_that_do_not_grow_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShakeError, match=r"levels \[0\.4, 0\.2\] must grow"):
        load_commission(settings(tmp_path, levels=[0.4, 0.2]))


def test_close_loop_seeks_at_the_highest_level_and_the_run_before_decides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[list[str], str]] = []

    def seek(_: object, estimation: list[TableRecording], validation: TableRecording, **__: object) -> Open:
        asked.append(([run.name for run in estimation], validation.name))
        return Open()

    settled = NextRecording((), None, Envelope(0.1, 1.0, 10.0), 0.001)
    monkeypatch.setattr("shake_ros.commissioning.commission.close_loop", seek)
    monkeypatch.setattr("shake_ros.commissioning.commission.next_recording", lambda *_, **__: settled)
    given = settings(tmp_path, levels=[0.3, 0.5], search_from=0.5, seconds=2.0)
    found = sr.commission("bergamo", settings=given, progress=False)
    assert found.complete
    assert asked == [(["step_2_level_0.5"], "step_1_level_0.3")]


class Open:
    """A search that leaves a question open until it has the recording of the motion asked for."""

    effects, open = (), True

    def __init__(self) -> None:
        self.heard: list[TableRecording] = []

    def extended(self, recording: TableRecording, **_: object) -> Open:
        self.heard.append(recording)
        return self


class Asked:
    """A quarter of a millimetre at 2 Hz."""

    distinguished = ("backlash instead of soft_zone",)
    motion = np.outer(np.sin(4.0 * np.pi * 0.001 * np.arange(1000)), [2.5e-4, 3e-3, 4e-2])

    def motion_at(self, _: float) -> np.ndarray:
        return self.motion


@pytest.mark.parametrize("released", [True, False])
def test_what_the_search_leaves_open_is_a_step_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, released: bool
) -> None:
    search, said, within = Open(), list[str](), list[dict[str, float]]()

    def design(_: Open, *, interlock: InterlockParameters, **__: object) -> Asked:
        within.append({name: interlock.limits[name] for name in HELD})
        return Asked()

    def release(text: str) -> bool:
        said.append(text)
        return released or "to distinguish" not in text

    monkeypatch.setattr("shake_ros.commissioning.commission.close_loop", lambda *_, **__: search)
    monkeypatch.setattr("shake_ros.commissioning.commission.next_recording", design)
    given = settings(tmp_path, levels=[0.3, 0.5], search_from=0.5, seconds=2.0)
    found = sr.commission("bergamo", settings=given, release=release, progress=False)
    assert found.complete
    assert "step 3, level 0.5, to distinguish backlash instead of soft_zone: 0.2 mm" in said[2]
    assert within == [dict(found.steps[1].limits)]
    purposes = ["", "", *(["to distinguish backlash instead of soft_zone"] if released else []), "for the evidence"]
    assert [step.purpose for step in found.steps] == purposes
    assert len(search.heard) == released
    if released:
        reference = search.heard[0].reference
        assert reference is not None and np.allclose(reference[:, 0], Asked.motion[:, 0])
