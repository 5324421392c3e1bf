"""The motion that tells rivals apart, on a declared table whose rivals are known."""

import dataclasses

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.core.discovery.problem import ScoredFit
from shake_ros.core.discovery.rival_models import RivalModel
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import FULL
from shake_ros.core.reference.motion import Envelope
from shake_ros.declared import free_parameters
from shake_ros.experiment_design.design import ENOUGH, HARDLY, Designer
from shake_ros.experiment_design.motions import library

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
    best, *others = designer.best(motions, lambda *_: None)
    assert best.separations[0].gain > ENOUGH
    assert best.rate >= max(p.rate for p in others)
    assert np.all(np.max(np.abs(best.samples), axis=0) <= np.array(LIMITS) * (1.0 + 1e-9))
    slow = next(p for p in (designer.predicted(m) for m in motions if m.name == "slow sine" and m.part < 0.2) if p)
    assert designer.separated(slow)[0].gain < best.separations[0].gain


def test_a_rival_that_differs_by_no_more_than_its_parameter_is_uncertain_is_not_distinguished(table, small_motion):
    found = fit_of(table)
    information, wide = Designer.of(FULL, found, [], LIMITS, small_motion).itself
    place = found.free.names.index("bulk_modulus.modulus")
    deviation = np.sqrt(wide * np.linalg.inv(information)[place, place]) * found.free.scale[place]
    stiffer = table.with_values({"bulk_modulus.modulus": table.value("bulk_modulus.modulus") + deviation})
    designer = Designer.of(FULL, found, [rival("stiffer", stiffer)], LIMITS, small_motion)
    motion = next(m for m in library() if m.kind == "multisine" and m.part == 0.5)
    shown = designer.predicted(motion)
    assert designer.separated(shown, refitted=False)[0].gain > HARDLY
    assert designer.separated(shown)[0].gain < HARDLY


def test_a_motion_that_any_rival_would_take_beyond_the_limits_is_left_out(table, small_motion):
    motion = next(m for m in library() if m.kind == "sine" and m.part == 1.0 and m.low == 2.0)
    fine = Designer.of(FULL, fit_of(table), [], Envelope(0.02, 0.25, 4.0), small_motion)
    smaller = dataclasses.replace(motion, part=0.5)
    assert fine.predicted(smaller) is not None
    faster = table.with_values({"valve.flow_coefficient": 3.0 * table.value("valve.flow_coefficient")})
    assert dataclasses.replace(fine, rivals=(rival("faster", faster),)).predicted(smaller) is None
