"""Several effects at once: those that a table has stay, the others do not; on tables written for these tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, Hidden, record

from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start import joint_start as joint
from shake_ros.fit.start.joint_start import MOST, joint_start, loss
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table

KNOWN = {c.effect: c for c in effect_candidates() if c.effect != "command_delay"}


def kept(hidden: Hidden) -> tuple[str, ...]:
    made = record(3, 4.0, hidden)
    recording = Record("made", SAMPLE_TIME, made.commands, made.position, made.acceleration)
    table, stay = joint_start(RecordingProblem([recording]), free_parameters(), KNOWN, load_table("bergamo"))
    assert set(stay) <= set(table.effects)
    return stay


def test_two_effects_that_a_table_has_stay() -> None:
    assert {"spool_deadband", "asymmetric_flow_gain"} <= set(kept(Hidden(dead_band=0.02, flow_asymmetry=0.1)))


def test_no_more_stay_than_a_few_and_none_without_a_start_of_its_own() -> None:
    stay = kept(Hidden(flow_asymmetry=0.2))
    assert stay[0] == "asymmetric_flow_gain" and len(stay) <= MOST
    assert all(KNOWN[name].together for name in stay)


def test_friction_with_a_memory_takes_part_only_where_a_fit_is_far(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = list[TableParameters]()

    def approached(_problem: Any, free: FreeParameters, start: np.ndarray, **_: Any) -> Fit:
        begun.append(free.table(start))
        strength = "effects.presliding_friction.distance"
        jacobian = np.diag([100.0 if name == strength else 1e-6 for name in free.names])
        return Fit(free, start, np.ones(len(start)), jacobian, 0.5 * len(start), 1)

    monkeypatch.setattr(joint, "approached", approached)
    pieces: Any = None
    late = {"presliding_friction", "film_friction"}
    stays = [joint_start(pieces, free_parameters(), KNOWN, load_table("bergamo"), far)[1] for far in (False, True)]
    assert stays == [(), ("presliding_friction",)]
    assert [late & set(table.effects) for table in begun] == [set(), late]
    assert begun[1].value("effects.presliding_friction.distance") == 2e-5


def test_loss_is_what_the_cost_rises_by_without_a_parameter() -> None:
    rng = np.random.default_rng(1)
    j = rng.standard_normal((200, 2)) @ np.array([[1.0, 0.6], [0.0, 0.8]])
    noise = rng.standard_normal(200)
    noise -= j @ np.linalg.lstsq(j, noise, rcond=None)[0]
    free = FreeParameters(load_table("bergamo"), list(free_parameters())[:2])
    x = np.array([3.0, 1.5])
    found = Fit(free, x, noise, j, 0.5 * float(noise @ noise), 1)
    rest = noise - j @ x  # residual of a linear model as a function of x: noise + j (x' − x)
    without = j[:, :1] @ np.linalg.lstsq(j[:, :1], -rest, rcond=None)[0] + rest
    rise = float(without @ without) / float(noise @ noise) - 1.0
    assert abs(loss(found, [free.names[1]]) / rise - 1.0) < 1e-6
