"""A search that goes on with more recordings, on the model axis, whose fits take a second."""

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.api.close_loop import _halves
from shake_ros.control.reference.motion import Envelope
from shake_ros.experiment_design import next_recording as designs
from shake_ros.experiment_design.design import PredictedExcitation, Separation
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import NextRecording, decide, next_recording
from shake_ros.fit.records import Record
from shake_ros.physics.plant.axis import AXIS_LAYOUT
from shake_ros.quantities import ShakeError

NUMBERS = {"mass": 10.0, "viscous": 20.0, "coulomb": 5.0, "offset": 0.0}


def run(name, frequency, size, seed):
    true = sr.model("axis", AXIS_LAYOUT.table({"axis": NUMBERS}, "axis"))
    time, noise = np.arange(1500) / 1000, np.random.default_rng(seed).normal(0.0, 1.0, (2, 1500))
    force = size * (100 * np.sin(9 * time) + 50 * np.sin(frequency * time))
    (start,) = sr.recording(name, time, 0 * time, 1e-9 * time, force=force).records("force")
    x, _, a = true.simulate(start).T
    return sr.recording(name, time, 0 * time, x + 1e-5 * noise[0], acceleration=a + 0.05 * noise[1], force=force)


@pytest.fixture(scope="module")
def found():
    first, second = run("first", 31, 0.2, 1), run("second", 41, 0.2, 2)
    return sr.close_loop(sr.model("axis"), first, second, progress=False)


def test_a_search_that_goes_on_fits_half_of_the_new_recording_and_knows_more(found):
    more = found.extended(run("third", 51, 1.0, 3), progress=False)
    assert {r.name for r in more.estimation} == {"first", "third"}
    assert {r.name for r in more.validation} == {"second", "third"}
    assert more.table.value("axis.mass") == pytest.approx(10.0, rel=0.01)
    before, after = (next(p for p in f.final.parameters if p.name == "axis.coulomb") for f in (found, more))
    assert after.std_error < before.std_error
    assert not more.remaining.above_noise


def test_of_a_recording_that_rests_at_first_half_of_the_motion_is_fitted():
    rest, motion = np.zeros(30000), 1e-4 * np.sin(0.01 * np.pi * np.arange(2000))
    position = np.concatenate([rest, motion])
    position += 3e-6 * np.random.default_rng(0).standard_normal(32000)
    first, second = _halves([Record("rests", 0.001, np.zeros(32000), position)])
    assert len(first[0].commands) == pytest.approx(31000, abs=60)
    assert len(first[0].commands) + len(second[0].commands) == 32000


def test_a_recording_that_the_search_has_had_is_refused(found):
    with pytest.raises(ShakeError, match="first: is among the recordings"):
        found.extended(run("first", 51, 1.0, 3), progress=False)


def test_a_design_needs_hydraulics(found):
    with pytest.raises(ShakeError, match="needs the model full or unknown, not axis"):
        next_recording(found, progress=False)


@pytest.fixture
def asked(found, monkeypatch):
    """The same motion is asked for again and again."""
    prediction = PredictedExcitation(
        library()[0], np.zeros((10, 3)), found.estimation[0], (Separation("another", 5.0, np.zeros(10)),)
    )
    made = NextRecording(("another",), prediction, Envelope(0.1, 1.0, 10.0), 0.001)
    monkeypatch.setattr(designs, "next_recording", lambda *_, **__: made)
    return made


def breaking(runs):
    """Plays these runs; then the graph is gone."""

    def play(*_, **__):
        if not runs:
            raise ShakeError("the graph has stopped")
        return runs.pop(0)

    return play


def test_an_error_in_the_second_recording_leaves_the_result_of_the_first(found, asked):
    kept = []
    third = run("third", 51, 1.0, 3)
    decided = decide(found, breaking([third]), most=3, extended=kept.append, progress=False)
    assert kept == [decided.found]
    assert {r.name for r in decided.found.estimation} == {"first", "third"}
    assert decided.played == (asked,)
    (failure,) = decided.found.failures
    assert failure.step == "further recording 2"
    assert "the graph has stopped" in failure.cause


def test_a_design_that_fails_leaves_the_result_of_the_recording_before_it(found, asked, monkeypatch):
    def played(_):
        monkeypatch.setattr(designs, "next_recording", breaking([]))
        return run("third", 51, 1.0, 3)

    decided = decide(found, played, progress=False)
    assert {r.name for r in decided.found.estimation} == {"first", "third"}
    assert decided.last is None
    assert [failure.step for failure in decided.found.failures] == ["next recording"]
