"""Where the nodes of a function go: kinks of stops on nodes, all nodes into a narrow bump, else as they are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters, null_shifts_of
from shake_ros.fit.least_squares import Fit
from shake_ros.physics.effects.unlisted import FLOW_GAIN_OF_TIME, FORCE_OF_POSITION, FRICTION_OF_POSITION, NODES
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.closed_form import FunctionForm, fitted_forms
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.problem import ScoredFit, SearchProblem
from shake_ros.search.refined_nodes import FLANK, better_range, with_refined_nodes
from shake_ros.search.unlisted_functions import KINDS, NODE_NAMES, PREFIX, UNLISTED
from shake_ros.settings import load_search, load_table

LOW, HIGH = -0.036, 0.032
AT = np.linspace(LOW, HIGH, NODES)


def form_of(values: np.ndarray) -> FunctionForm:
    return fitted_forms(AT, values, np.zeros(NODES))[0]


def nodes(ends: tuple[float, float] | None) -> np.ndarray:
    assert ends is not None
    return np.linspace(*ends, NODES)


def test_the_kinks_of_stops_come_to_lie_on_nodes() -> None:
    stops = form_of(9e5 * np.sign(AT) * np.maximum(np.abs(AT) - 0.0201, 0.0))
    assert stops.name == "stops" and stops.parameters["g"] == pytest.approx(0.0201, rel=0.02)
    found = nodes(better_range(FORCE_OF_POSITION, LOW, HIGH, stops))
    for side in (-1.0, 1.0):
        assert np.min(np.abs(found - side * stops.parameters["g"])) < 1e-9
    assert abs(found[0] - LOW) < 0.006 and abs(found[-1] - HIGH) < 0.006


def test_a_narrow_bump_gets_all_nodes() -> None:
    bump = form_of(-285.0 + 1100.0 * np.exp(-0.5 * ((AT + 0.010) / 0.004) ** 2))
    assert bump.name == "bump" and bump.parameters["b"] == pytest.approx(-285.0, rel=0.05)
    found = nodes(better_range(FRICTION_OF_POSITION, LOW, HIGH, bump))
    assert found[0] == pytest.approx(-0.010 - FLANK * 0.004, abs=0.002)
    assert found[-1] == pytest.approx(-0.010 + FLANK * 0.004, abs=0.002)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (FORCE_OF_POSITION, 1e4 * AT),
        (FRICTION_OF_POSITION, 9e5 * np.sign(AT) * np.maximum(np.abs(AT) - 0.0201, 0.0)),
        (FLOW_GAIN_OF_TIME, np.exp(-0.5 * (AT / 0.05) ** 2)),
    ],
    ids=["no kink", "a kind that is constant beyond", "a wide bump"],
)
def test_else_the_range_stays(kind: int, values: np.ndarray) -> None:
    assert better_range(kind, LOW, HIGH, form_of(values)) is None


def test_nodes_move_with_the_null_shift_of_each_recording_as_it_was() -> None:
    kind = KINDS[FRICTION_OF_POSITION]
    own = {PREFIX + "kind": kind.code, PREFIX + "low": LOW, PREFIX + "high": HIGH}
    nodes = [FreeParameter(name, kind.scale, kind.low, kind.high, kind.unit) for name in NODE_NAMES]
    free = FreeParameters(load_table("bergamo").with_values(own), [*null_shifts_of(2, ()), *nodes])
    bump = -285.0 + 1100.0 * np.exp(-0.5 * ((AT + 0.010) / 0.004) ** 2)
    x = np.concatenate([[3.0, -2.0], bump / kind.scale])
    starts: list[np.ndarray] = []

    def fitted(more: FreeParameters, start: np.ndarray, *_: object, **__: object) -> ScoredFit:
        starts.append(start * more.scale)
        return ScoredFit(Fit(more, start, np.zeros(1), np.zeros((1, len(start))), 0.0, 1), 1.0, 1.0)

    chosen = Refit(
        CandidateEffect(UNLISTED, tuple(nodes), (), kind.place, kind.depends_on),
        ScoredFit(Fit(free, x, np.zeros(1), np.zeros((1, len(x))), 0.0, 1), 2.0, 2.0),
        0.5,
    )
    problem = SimpleNamespace(progress=lambda *_: None, settings=load_search(), fitted=fitted)
    step = with_refined_nodes(cast("SearchProblem", problem), ForwardStep(chosen, (chosen,)))
    (start,) = starts
    assert start[:2] == pytest.approx([3e-3, -2e-3])
    low, high = start[-2:]
    assert np.interp(-0.010, np.linspace(low, high, NODES), start[2:-2]) == pytest.approx(815.0, rel=0.05)
    assert step.chosen.result.fit.free.names[-2:] == (PREFIX + "low", PREFIX + "high")
