"""The twin over recordings of an independent simulator that changes from one recording to the next."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table
from shake_ros.twin.follow import Following, follow
from shake_ros.twin.followed import TwinSettings, load_twin
from shake_ros.twin.twin import NAMING, Twin, TwinWindow

DEPTH = 0.3  # of the soft zone
SOFTER = 0.75  # bulk modulus of the oil over what it was
TRUTH = hidden.declared_truth(71)
TABLE = load_table("bergamo").with_values({name: getattr(TRUTH, field) for name, field in hidden.DECLARED.items()})


def recording(name: str, truth: hidden.Truth, seconds: float, seed: int) -> sr.Recordings:
    rng = np.random.default_rng(seed)
    made = hidden.record(truth, hidden.multisine(seconds, 1, 0.5, 8.0, 0.2, rng), 1.0, rng, 20)
    at = np.arange(len(made["command"])) * hidden.SAMPLE
    return sr.recording(name, at, made["command"], made["position"], acceleration=made["acceleration"])


def quick() -> TwinSettings:
    settings = load_twin()
    return replace(settings, test=settings.test.replace(reference=8.0, naming=4.0))


def changed_to(truth: hidden.Truth) -> Following:
    runs = recording("before", TRUTH, 12.5, 1) + recording("after", truth, 6.5, 2)
    return follow(runs, TABLE, settings=quick(), progress=False)


@pytest.fixture(scope="module")
def followed() -> Following:
    return changed_to(TRUTH._replace(soft_zone=DEPTH))


@pytest.fixture(scope="module")
def softened() -> Following:
    return changed_to(TRUTH._replace(modulus=SOFTER * TRUTH.modulus))


def test_softer_oil_is_named_and_not_a_dead_volume_of_nearly_the_same_response(softened: Following) -> None:
    (change,) = softened.changes
    assert change.named.explained
    assert change.named.best.name == "bulk_modulus.modulus"
    assert change.named.best.after == pytest.approx(SOFTER * TRUTH.modulus, rel=0.05)
    assert softened.table.value("bulk_modulus.modulus") == pytest.approx(SOFTER * TRUTH.modulus, rel=0.05)
    assert softened.table.value("effects.dead_volume.volume") == 0.0


@pytest.mark.second_tier
def test_a_delay_is_named_and_not_a_slower_valve_of_nearly_the_same_response() -> None:
    found = changed_to(TRUTH._replace(command_delay=0.002))
    (change,) = found.changes
    assert change.named.explained
    assert change.named.best.name == "command_delay"
    assert found.table.value("effects.command_delay.delay") == pytest.approx(0.002, rel=0.1)
    assert found.table.value("effects.slow_valve.slowdown") == 0.0


@pytest.mark.second_tier
def test_a_fault_that_grows_is_one_change_with_its_latest_size() -> None:
    parts = (1.0, 0.9, SOFTER)
    runs = [recording(f"run_{i}", TRUTH._replace(modulus=p * TRUTH.modulus), 12.5, i) for i, p in enumerate(parts)]
    found = follow([r for run in runs for r in run], TABLE, settings=quick(), progress=False)
    (change,) = found.changes
    assert change.recording == "run_1"
    assert change.named.best.name == "bulk_modulus.modulus"
    assert change.named.best.after == pytest.approx(SOFTER * TRUTH.modulus, rel=0.05)


def test_a_soft_zone_is_named_with_its_depth_and_its_instant(followed: Following) -> None:
    (change,) = followed.changes
    best = change.named.best
    assert change.named.verdict == "established"
    assert best.parameter == "effects.soft_zone.depth"
    assert best.after == pytest.approx(DEPTH, abs=0.05)
    assert (change.recording, change.at < 3.0) == ("after", True)
    before, since, left = change.named.error
    assert since > 2.0 * before
    assert left < 0.5 * since


def test_values_stay_as_before_a_change_until_it_is_named(softened: Following) -> None:
    first = [w.state for w in softened.known].index(NAMING)
    before, naming = (w.values for w in softened.known[first - 1 : first + 1])
    assert naming == pytest.approx(before)
    assert naming[softened.names.index("bulk_modulus.modulus")] == pytest.approx(TRUTH.modulus, rel=0.02)


def test_the_table_is_left_with_what_changed(followed: Following, tmp_path: Path) -> None:
    followed.report(tmp_path / "out")
    table = load_table(str(tmp_path / "out" / "table.yaml"))
    assert table.value("effects.soft_zone.depth") == pytest.approx(DEPTH, abs=0.05)
    content = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert content["changes"][0]["best"]["parameter"] == "effects.soft_zone.depth"
    assert len(content["windows"][-1]["values"]) == len(content["parameters"])
    assert "soft_zone: depth" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def samples(seconds: float, truth: hidden.Truth = TRUTH, seed: int = 3, begin: float = 1.0) -> tuple[np.ndarray, ...]:
    (run,) = recording("run", truth, seconds, seed)
    assert run.acceleration is not None
    stamps = np.rint((begin + run.time) * 1e9).astype(np.int64)
    return stamps, run.valve_command.copy(), run.position.copy(), run.acceleration.copy()


def test_a_change_is_named_though_the_clock_of_the_recorder_begins_anew_behind_it() -> None:
    softer, twin = TRUTH._replace(modulus=SOFTER * TRUTH.modulus), Twin(TABLE, quick(), 1e-3)
    runs = {
        "before": samples(12.5, begin=1e6),
        "onset": samples(2.6, softer, 4, 1e6 + 13.0),
        "after": samples(6.5, softer),
    }
    windows = list[TwinWindow]()
    for name, columns in runs.items():
        twin.begin(name)
        windows += twin.add(*columns)
    (change,) = (w.change for w in windows if w.change)
    assert (change.recording, change.named.best.name) == ("onset", "bulk_modulus.modulus")


def test_windows_do_not_depend_on_how_samples_arrive() -> None:
    columns = samples(5.0)
    whole = list(Twin(TABLE, load_twin(), 1e-3).add(*columns))
    twin = Twin(TABLE, load_twin(), 1e-3)
    pieces = [w for k in range(0, 5000, 37) for w in twin.add(*(c[k : k + 37] for c in columns))]
    assert [(w.start, w.stamp) for w in whole] == [(w.start, w.stamp) for w in pieces]
    assert len(whole) == 2


@pytest.mark.parametrize(("column", "words"), [(2, "the position stands still"), (3, "the acceleration stands still")])
def test_a_frozen_sensor_pauses_the_twin_in_one_line(column: int, words: str) -> None:
    columns = samples(4.7)
    columns[column][1000:2000] = columns[column][1000]
    first, second = Twin(TABLE, load_twin(), 1e-3).add(*columns)
    assert first.state == "paused"
    assert words in first.note
    assert second.state == "learning"


def test_a_command_that_stands_still_while_the_table_moves_pauses_the_twin() -> None:
    columns = samples(2.5)
    columns[1][:] = 0.0
    (window,) = Twin(TABLE, load_twin(), 1e-3).add(*columns)
    assert "manual control" in window.note


def test_samples_that_stop_are_reported_and_the_twin_goes_on_behind_them() -> None:
    columns = tuple(np.delete(c, slice(1500, 2300)) for c in samples(5.0))
    pause, window = Twin(TABLE, load_twin(), 1e-3).add(*columns)
    assert pause.note == "no samples for 0.80 s"
    assert window.state == "learning"


def test_the_file_of_another_table_is_refused() -> None:
    other = TABLE.with_values({"valve.flow_coefficient": 4e-8, "body.table_mass": 4000.0})
    with pytest.raises(ShakeError, match="another table"):
        follow(recording("run", TRUTH, 8.7, 4), other, settings=quick(), progress=False)


def test_too_little_motion_is_one_line() -> None:
    with pytest.raises(ShakeError, match="20 s of motion show what is normal; the recordings hold 2 s"):
        follow(recording("run", TRUTH, 3.0, 4), TABLE, progress=False)


@pytest.mark.parametrize(("topic", "sensor"), [("imu", "position"), ("joint_states", "acceleration")])
def test_a_recording_without_one_of_the_sensors_is_refused(topic: str, sensor: str) -> None:
    at = np.arange(3000) * 1e-3
    run = sr.recording("run", at, np.sin(at), **{sensor: 0.01 * np.cos(at)})
    with pytest.raises(ShakeError, match=f"run: no topic {topic}"):
        follow(run, TABLE, progress=False)
