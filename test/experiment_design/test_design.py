"""The motion that tells rivals apart, on a declared table whose rivals are known."""

import dataclasses
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_table import SCALED

import shake_ros as sr
from shake_ros.control.reference.motion import Envelope, envelope
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.experiment_design.design import ENOUGH, HARDLY, Designer, possible_effects
from shake_ros.experiment_design.further_sensors import further_sensors, lacking
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import (
    GROWTH,
    WITHIN,
    NextRecording,
    limits_of,
    may_lack,
    next_recording,
    remedies,
)
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.quantities import ShakeError
from shake_ros.repair.rival_models import RivalModel
from shake_ros.search.problem import ScoredFit, linearised
from shake_ros.settings import load_interlock

MOVED = ("friction.viscous", "friction.coulomb_level", "bulk_modulus.modulus")
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
    assert fine.harmless(fine.predicted(smaller), [fine.found])
    assert not fine.harmless(fine.predicted(smaller), faster)
    assert dataclasses.replace(fine, rivals=faster).best([smaller], lambda *_: None) is None
    with_absent = dataclasses.replace(fine, absent=faster)
    assert with_absent.best([smaller], lambda *_: None).motion.part < 0.5  # a smaller neighbour of it


def test_a_motion_of_a_table_with_little_damping_is_not_made_smaller_as_its_loop_would_ring(table, small_motion):
    body = {"body.table_mass": 1300.0, "body.specimen_mass": 0.0, "body.piston_area": 1e-3, "valve.underlap": 0.006}
    volume = {"body.cylinder_volume": 3.1e-4, "bulk_modulus.modulus": 7.2e8, "valve.flow_coefficient": 4e-7}
    light = {"leakage.internal": 6e-13, "friction.coulomb_level": 130.0, "friction.stribeck_rise": 40.0}
    designer = Designer.of(FULL, fit_of(table.with_values(body | volume | light)), [], LIMITS, small_motion)
    for motion in (m for m in library() if m.part == 0.15 and m.kind in ("multisine", "random", "pulses")):
        assert designer.predicted(motion).motion.part == motion.part


@pytest.fixture(scope="module")
def drooping(table, small_motion):
    """A table whose supply gives way, which its interlock takes for a valve that does not answer."""
    weak = {"effects.supply_droop.resistance": 3e10, "effects.supply_droop.time_constant": 0.1}
    found = fit_of(table.with_values(weak))
    limits = Envelope(*(WITHIN * np.array(envelope(found.table))))
    return Designer.of(FULL, found, [], limits, small_motion, interlock=load_interlock("bergamo"))


def test_a_dwell_that_the_interlock_would_hold_is_asked_for_only_as_large_as_it_passes(drooping):
    dwell, sine = (next(m for m in library() if (m.name, m.part) == asked) for asked in (("dwell", 1.0), ("sine", 0.5)))
    free = dataclasses.replace(drooping, interlock=None)
    assert free.predicted(dwell).motion == dwell  # as it was played, and stopped by valve_implausible
    assert drooping.predicted(dwell).motion.part < 1.0
    assert not drooping.harmless(free.predicted(dwell), [drooping.found])
    assert drooping.predicted(sine).motion == sine
    deaf = drooping.interlock.causes.replace(
        valve_implausible=drooping.interlock.response("valve_implausible").replace(action="none")
    )
    assert (
        dataclasses.replace(drooping, interlock=drooping.interlock.replace(causes=deaf)).predicted(dwell).motion
        == dwell
    )


def test_an_interlock_takes_a_motion_down_to_its_own_limits(drooping):
    slow = drooping.interlock.causes.replace(velocity=drooping.interlock.response("velocity").replace(threshold=0.05))
    small = dataclasses.replace(drooping, interlock=drooping.interlock.replace(causes=slow))
    sine = next(m for m in library() if (m.name, m.part) == ("sine", 1.0))
    assert 0.03 < np.max(np.abs(small.predicted(sine).samples[:, 1])) < 0.05


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


def test_an_effect_that_a_parameter_makes_up_for_is_not_excluded(table):
    """Oil that is as much softer as a dead volume makes it, over a sweep through the oil's resonance."""
    dead, half = 3e-5, 0.5 * table.value("body.cylinder_volume")
    time, noise = np.arange(4000) / 1000, np.random.default_rng(0).standard_normal((2, 4000))
    sweep = 0.05 * np.sin(2 * np.pi * (6 + 4 * time) * time)
    run = sr.simulate(table.with_values({"effects.dead_volume.volume": dead}), sweep)
    x, _, a = run.recording.truth.T
    (record,) = sr.recording("r", time, run.command, x + 5e-6 * noise[0], acceleration=a + 0.05 * noise[1]).records(
        "valve_command"
    )
    problem, modulus = RecordingProblem([record], FULL), "bulk_modulus.modulus"
    softer = table.with_values({modulus: table.value(modulus) * half / (half + dead)})
    found = linearised(problem, fit_of(softer))
    candidates = [c for c in effect_candidates() if c.effect in ("dead_volume", "command_delay")]
    (fit,) = possible_effects(problem, found, 1.0, candidates).values()  # nothing makes up for a delay
    assert fit.table.value("effects.dead_volume.volume") == dead
    assert fit.table.value(modulus) == pytest.approx(table.value(modulus), rel=0.01)


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


@pytest.mark.parametrize(
    ("states", "above_noise", "asks"),
    [
        ((), False, True),  # nothing is named: what else may be there?
        (("established",), False, False),  # another effect could merely exist as well
        (("established",), True, True),  # something is there that no model explains
        (("established", "likely"), False, False),  # a rival may be told from it; that is another question
        (("one of these",), False, True),
    ],
)
def test_absent_effects_are_a_question_where_nothing_is_established_or_a_residual_remains(states, above_noise, asks):
    closed = SimpleNamespace(verdicts=[SimpleNamespace(state=state) for state in states])
    assert may_lack(SimpleNamespace(closed=closed, remaining=SimpleNamespace(above_noise=above_noise))) == asks


def test_an_established_answer_ends_the_series(table, small_motion, monkeypatch):
    step = SimpleNamespace(chosen=SimpleNamespace(candidate=SimpleNamespace(effect="soft_zone")))
    search = SimpleNamespace(steps=[step], final=SimpleNamespace(fit=fit_of(table)))
    closed = SimpleNamespace(verdicts=[SimpleNamespace(state="established")], search=search)
    found = SimpleNamespace(
        model=sr.model("full"), table=table, closed=closed, estimation=small_motion, records=small_motion, rivals=(),
        open=False, remaining=SimpleNamespace(above_noise=False),
    )  # fmt: skip
    asked = next_recording(found, progress=False)
    assert not asked.open and asked.motion is None
    assert list(asked.lines()) == ["nothing is open: no further recording is needed"]
    closed.verdicts[0].state = "one of these"
    monkeypatch.setattr(Designer, "best", lambda designer, *_: sought.append(designer.absent))
    sought = []
    next_recording(found, progress=False)
    assert sought[0] and "soft_zone" not in [effect.name for effect in sought[0]]


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
    found = remedies(designer, shown, lacking(further_sensors(), designer.like))
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
    known = dataclasses.replace(small_motion[0], pressure=small_motion[0].position)
    names = [s.name for s in lacking(further_sensors(), known)]
    assert "chamber pressure sensors" not in names
    assert "second accelerometer on the table" in names
    blind = dataclasses.replace(small_motion[0], acceleration=None)
    names = [s.name for s in lacking(further_sensors(), blind)]
    assert "accelerometer on the table" in names
    assert "chamber pressure sensors" in names


def test_the_end_states_in_a_sentence_what_would_distinguish_the_rivals(alike):
    designer, shown = alike
    sensors = lacking(further_sensors(), designer.like)
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


@pytest.mark.parametrize("known", [{}, {"stroke": 0.26}])
def test_a_motion_keeps_off_the_stops_that_an_unknown_table_has_somewhere(table, small_motion, known):
    reached = max(np.ptp(r.position) for r in small_motion) / 2.0
    allowed = limits_of(SimpleNamespace(table=table, model=sr.model("unknown", set=known), records=small_motion))
    assert allowed.position == pytest.approx(WITHIN * 0.13 if known else GROWTH * reached)
