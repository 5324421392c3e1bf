"""The motion that tells rivals apart, on a declared table whose rivals are known."""

import dataclasses
import json
import re

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.core.discovery.problem import ScoredFit
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import FULL
from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.motion import Envelope
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.experiment_design.design import ENOUGH, HARDLY, Designer
from shake_ros.experiment_design.further_sensors import further_sensors, lacking
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import NextRecording, remedies
from shake_ros.search.rival_models import RivalModel

MOVED = ("friction.viscous", "friction.coulomb_level", "bulk_modulus.modulus")
SCALED = {  # exponents of a common factor that leaves the motion of a table as it is
    "body.table_mass": 1.0, "body.specimen_mass": 1.0, "supply.supply_pressure": 1.0, "supply.tank_pressure": 1.0,
    "valve.flow_coefficient": -0.5, "valve.laminar_pressure": 1.0, "bulk_modulus.modulus": 1.0,
    "bulk_modulus.reference_pressure": 1.0, "friction.coulomb_level": 1.0, "friction.stribeck_rise": 1.0,
    "friction.viscous": 1.0, "leakage.internal": -1.0, "leakage.external": -1.0,
}  # fmt: skip
FREE = [p for p in free_parameters() if p.name in MOVED]
LIMITS = Envelope(0.05, 0.4, 6.0)


def fit_of(table):
    free = FreeParameters(table, FREE)
    return Fit(free, free.start(), np.zeros(1), np.zeros((1, len(FREE))), 0.0, 0)


def rival(name, table):
    return RivalModel(name, ScoredFit(fit_of(table), 1.0, 1.0))


@pytest.fixture(scope="module")
def table():
    return sr.model("full").table


@pytest.fixture(scope="module")
def small_motion(table):
    """A recording that hardly moves."""
    time = np.arange(3000) / 1000
    run = sr.simulate(table, 0.02 * np.sin(2 * np.pi * 3 * time))
    rng = np.random.default_rng(0)
    position, acceleration = run.recording.truth[:, 0], run.recording.truth[:, 2]
    noisy = position + 5e-6 * rng.standard_normal(3000), acceleration + 0.05 * rng.standard_normal(3000)
    return sr.recording("small", time, run.command, noisy[0], acceleration=noisy[1]).records("valve_command")


def test_a_motion_is_found_that_tells_a_droop_of_the_supply_from_its_absence(table, small_motion):
    without = rival("without supply_droop", table)
    drooping = fit_of(table.with_values({"effects.supply_droop.resistance": 3e9}))
    designer = Designer.of(FULL, drooping, [without], LIMITS, small_motion)
    motions = [m for m in library() if m.kind in ("sine", "multisine", "triangle")]
    best = designer.best(motions, lambda *_: None)
    assert best.separations[0].gain > ENOUGH
    assert np.all(np.max(np.abs(best.samples), axis=0) <= np.array(LIMITS) * (1.0 + 1e-9))
    slow = next(p for p in (designer.predicted(m) for m in motions if m.name == "slow sine" and m.part < 0.2) if p)
    slow = designer.separated(slow)
    assert slow.separations[0].gain < best.separations[0].gain
    assert slow.rate < best.rate


def test_a_rival_that_differs_by_no_more_than_its_parameter_is_uncertain_is_not_distinguished(table, small_motion):
    found = fit_of(table)
    itself = Designer.of(FULL, found, [], LIMITS, small_motion).found
    place = found.free.names.index("bulk_modulus.modulus")
    deviation = np.sqrt(itself.wide * np.linalg.inv(itself.information)[place, place]) * found.free.scale[place]
    stiffer = table.with_values({"bulk_modulus.modulus": table.value("bulk_modulus.modulus") + deviation})
    designer = Designer.of(FULL, found, [rival("stiffer", stiffer)], LIMITS, small_motion)
    motion = next(m for m in library() if m.kind == "multisine" and m.part == 0.5)
    shown = designer.predicted(motion)
    fixed = dataclasses.replace(designer.found, information=1e12 * designer.found.information)
    rigid = dataclasses.replace(
        designer, rivals=(dataclasses.replace(designer.rivals[0], information=fixed.information),)
    )
    assert rigid.separated(shown).separations[0].gain > HARDLY
    assert designer.separated(shown).separations[0].gain < HARDLY


def test_a_motion_that_any_rival_would_take_beyond_the_limits_is_left_out(table, small_motion):
    motion = next(m for m in library() if m.kind == "sine" and m.part == 1.0 and m.low == 2.0)
    fine = Designer.of(FULL, fit_of(table), [], Envelope(0.02, 0.25, 4.0), small_motion)
    smaller = dataclasses.replace(motion, part=0.5)
    assert fine.predicted(smaller) is not None
    faster = fit_of(table.with_values({"valve.flow_coefficient": 3.0 * table.value("valve.flow_coefficient")}))
    faster = (dataclasses.replace(fine.found, fit=faster),)
    assert dataclasses.replace(fine, rivals=faster).predicted(smaller) is None
    assert fine.harmless(fine.predicted(smaller))
    assert not dataclasses.replace(fine, absent=faster).harmless(fine.predicted(smaller))


@pytest.fixture(scope="module")
def unexplored(table, small_motion):
    """A model without rivals, which may lack a deadband of the spool or a drag that grows with the square of speed."""
    absent = [c for c in effect_candidates() if c.effect in ("spool_deadband", "quadratic_drag")]
    return Designer.of(FULL, fit_of(table), [], LIMITS, small_motion, absent)


def test_of_the_absent_effects_those_remain_that_the_recordings_do_not_exclude(table, small_motion, unexplored):
    (drag,) = unexplored.absent
    assert drag.name == "quadratic_drag"
    assert drag.fit.table.value("effects.quadratic_drag.coefficient") == 2.5e4
    problem = RecordingProblem(small_motion)
    before, after = (np.sum(problem.residuals(fit.vector[None, :]) ** 2) for fit in (unexplored.found.fit, drag.fit))
    assert 0.5 * (after - before) / unexplored.found.wide < HARDLY


def test_without_a_rival_the_motion_shows_what_no_recording_has_visited(small_motion, unexplored):
    best = unexplored.best([m for m in library() if m.kind in ("sine", "multisine")], lambda *_: None)
    asked = NextRecording((), best, LIMITS, 0.001)
    assert asked.shown == ("quadratic_drag",) and asked.motion is not None
    assert np.max(np.abs(best.samples[:, 1])) > 3.0 * np.max(np.abs(small_motion[0].velocity))
    text = list(asked.lines())
    assert text[0] == "the model found does not explain all, and no rival model is known"
    assert text[-1] == "  shows or excludes, which no recording does so far: quadratic_drag"
    content = json.loads(json.dumps(asked.content()))
    assert content["absent"]["quadratic_drag"]["log_odds"] > HARDLY
    assert content["separates"] == [[[], "quadratic_drag"]]
    explained = dataclasses.replace(asked, undecided=False)
    assert explained.open and explained.motion is not None
    assert "they do not exclude all other effects" in next(explained.lines())


def test_nothing_is_open_once_the_recordings_exclude_every_other_effect(unexplored):
    excluded = dataclasses.replace(unexplored, absent=())
    best = excluded.best([m for m in library() if m.kind == "sine"], lambda *_: None)
    asked = NextRecording((), best, LIMITS, 0.001, undecided=False)
    assert not asked.open and asked.motion is None
    assert list(asked.lines()) == ["nothing is open: no further recording is needed"]


@pytest.fixture(scope="module")
def alike(table, small_motion):
    """A rival that moves in the same way, heavier and on a higher pressure, and a motion of both."""
    heavier = table.with_values({name: 1.3**power * table.value(name) for name, power in SCALED.items()})
    designer = Designer.of(FULL, fit_of(table), [rival("heavier", heavier)], LIMITS, small_motion)
    motion = next(m for m in library() if m.kind == "sine" and m.low == 2.0 and m.part == 0.5)
    return designer, designer.separated(designer.predicted(motion))


def test_what_the_motion_does_not_tell_the_pressure_and_the_force_of_the_rod_do(alike):
    designer, shown = alike
    assert shown.separations[0].gain < HARDLY
    found = remedies(designer, shown, lacking(further_sensors(), designer.like, ()))
    gains = {name: made[0].gain for name, made in found.items()}
    assert gains["chamber pressure sensors"] > ENOUGH
    assert gains["load cell on the rod"] > ENOUGH
    assert gains["accelerometer on the base"] < HARDLY
    assert gains["second accelerometer on the table"] < HARDLY
    noisier = [dataclasses.replace(s, noise=1e4 * s.noise) for s in further_sensors() if s.signal == "rod_force"]
    assert designer.with_sensors(shown, noisier)["load cell on the rod"][0].gain < HARDLY


def test_a_payload_distinguishes_what_moves_in_the_same_way_without_it(alike):
    designer, shown = alike
    heavy = designer.heavier(0.3)
    assert heavy.separated(heavy.predicted(shown.motion)).separations[0].gain > HARDLY > shown.separations[0].gain


def test_only_what_the_table_lacks_is_a_further_sensor(small_motion):
    names = [s.name for s in lacking(further_sensors(), small_motion[0], ("pressure_a", "pressure_b"))]
    assert "chamber pressure sensors" not in names
    assert "second accelerometer on the table" in names
    blind = dataclasses.replace(small_motion[0], acceleration=None)
    names = [s.name for s in lacking(further_sensors(), blind, ())]
    assert "accelerometer on the table" in names
    assert "chamber pressure sensors" in names


def test_the_end_states_in_a_sentence_what_would_distinguish_the_rivals(alike):
    designer, shown = alike
    sensors = lacking(further_sensors(), designer.like, ())
    asked = NextRecording(
        ("heavier",), shown, LIMITS, 0.001, further=remedies(designer, shown, sensors), answers=(("a",), ("a", "b"))
    )
    assert asked.motion is None
    text = "\n".join(asked.lines())
    assert "no motion within 50 mm, 0.4 m/s and 6 m/s² settles anything with the sensors of this table" in text
    assert re.search(r"^  chamber pressure sensors: heavier \(expected odds over 1 000 000 : 1\)$", text, re.MULTILINE)
    assert "accelerometer on the base" not in text
    content = json.loads(json.dumps(asked.content()))
    assert content["schema"] == "shake_ros.next/1"
    assert content["open"] and content["motion"] is None and content["separates"] == []
    assert "chamber pressure sensors" in content["cannot"]
    assert content["further"]["chamber pressure sensors"]["heavier"]["log_odds"] > ENOUGH


def test_what_settles_nothing_more_is_named_too(alike):
    designer, shown = alike
    base = [s for s in further_sensors() if s.signal == "base_acceleration"]
    asked = NextRecording(("heavier",), shown, LIMITS, 0.001, further=designer.with_sensors(shown, base))
    assert "nor would any of these with the same motion: accelerometer on the base" in list(asked.lines())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{a: {signal: pressure, noise: 1}}", "pressure"),
        ("{a: {signal: rod_force, noise: 0}}", "a: noise: expected a number above 0"),
        ("{a: {signal: rod_force}}", "noise"),
    ],
)
def test_a_wrong_list_of_sensors_names_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ShakeError, match=said):
        further_sensors(str(path))
