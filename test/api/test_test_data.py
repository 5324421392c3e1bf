"""Test data: they change nothing of the answer, and every model's error on them stands in the report."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from closed_loops import LEAN
from hidden_table import SAMPLE_TIME, Hidden, record

import shake_ros as sr
from shake_ros.api import close_loop as verb
from shake_ros.api import model as opening
from shake_ros.declared import model_structure
from shake_ros.fit.start.stages import StartingPoint
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

VOLTS, SHIFTS, BIASES = 10.0, (0.004, -0.006, 0.001, 0.008), (0.05, -0.1, 0.02, 0.3)
OPEN = (
    "friction.coulomb_level",
    "friction.stribeck_rise",
    "friction.stribeck_decay",
    "friction.viscous",
    "bulk_modulus.modulus",
    "leakage.internal",
    "valve.flow_coefficient",
)


def laboratory(name: str, seed: int, scale: float = 1.0, shift: float = 0.0, bias: float = 0.0) -> sr.Recordings:
    """A recording with a scale of the command, a null shift of the valve and a bias of the accelerometer of its own."""
    made = record(seed, 2.5, Hidden(null_shift=shift))
    time = np.arange(len(made.commands)) * SAMPLE_TIME
    return sr.recording(name, time, scale * made.commands, made.position, acceleration=made.acceleration + bias)


def closed(
    monkeypatch: pytest.MonkeyPatch, model: Any, runs: list[sr.Recordings], test: sr.Recordings | None
) -> sr.Discovery:
    """`close_loop` with no effect to try."""
    monkeypatch.setattr(verb, "recordings_to_make", lambda: ())
    monkeypatch.setattr(
        verb, "model_structure", lambda *given: dataclasses.replace(model_structure(*given), candidates=(), shown=())
    )
    return sr.close_loop(model, runs[0] + runs[1], runs[2], test=test, settings=LEAN, progress=False)


def written(found: sr.Discovery, out: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((found.report(out) / "report.json").read_text(encoding="utf-8"))
    assert content["failed"] == []
    return content


def without_test(content: Any) -> Any:
    """A report without what stands in it of test data."""
    if isinstance(content, dict):
        return {key: without_test(value) for key, value in content.items() if key != "test"}
    return [without_test(value) for value in content] if isinstance(content, list) else content


def test_the_worst_test_data_change_nothing_of_the_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [laboratory(name, seed) for name, seed in (("first", 1), ("second", 2), ("third", 3))]
    wrong = laboratory("wrong", 4, scale=-0.7)
    with_it, alone = (closed(monkeypatch, sr.model("full"), runs, test) for test in (wrong, None))
    content, plain = written(with_it, tmp_path / "with"), written(alone, tmp_path / "alone")
    assert without_test(content) == without_test(plain)
    assert (content["recordings"]["test"], plain["recordings"]["test"]) == (["wrong"], [])
    assert content["final"]["error"]["test"]["wrong"]["velocity"] > 1.0
    assert set(content["baseline"]["error"]["test"]) == {"wrong"}
    assert "test" in list(with_it.error["data"])
    assert re.search("^wrong +test ", str(with_it), re.MULTILINE)
    page = (tmp_path / "with" / "report.html").read_text(encoding="utf-8")
    assert "tested on wrong" in page and "acceleration, test data" in page
    assert "test data" not in (tmp_path / "alone" / "report.html").read_text(encoding="utf-8")


def test_test_data_of_an_unknown_table_have_scale_and_sensors_of_the_others_and_offsets_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table: dict[str, Any] = load_table("bergamo").to_mapping()
    for name in OPEN:
        section, field = name.split(".")
        value = table[section][field]
        table[section][field] = {"value": value, "sd": 2.0 * abs(value)}
    (tmp_path / "open.yaml").write_text(yaml.safe_dump(table), encoding="utf-8")
    monkeypatch.setattr(
        opening, "staged_start", lambda m, free, effects, data, _: StartingPoint.declared(m.table, data)
    )
    names = ("first", "second", "third", "fourth")
    runs = [laboratory(name, i + 1, VOLTS, SHIFTS[i], BIASES[i]) for i, name in enumerate(names)]
    found = closed(monkeypatch, sr.model("full", tmp_path / "open.yaml"), runs, runs[3])
    error = written(found, tmp_path / "out")["final"]["error"]
    for channel in ("velocity", "acceleration"):
        assert error["test"]["fourth"][channel] < 1.5 * error["hold"]["third"][channel]
    shift = {n.recording: n.null_shift for n in found.data.nuisances}
    assert shift["fourth"] - shift["third"] == pytest.approx(SHIFTS[3] - SHIFTS[2], abs=1e-3)


@pytest.mark.parametrize("role", ["estimation", "validation"])
def test_recording_that_is_test_data_as_well_is_refused(role: str) -> None:
    first, second = laboratory("first", 1), laboratory("second", 2)
    with pytest.raises(ShakeError, match=f"given both as {role} and as test data"):
        sr.close_loop(sr.model("full"), first, second, test=first if role == "estimation" else second, progress=False)
