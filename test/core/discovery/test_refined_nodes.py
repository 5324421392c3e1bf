"""Where the nodes of a function go: kinks of stops on nodes, all nodes into a narrow bump, else as they are."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.core.discovery.closed_form import FunctionForm, fitted_forms
from shake_ros.core.discovery.refined_nodes import FLANK, better_range
from shake_ros.core.effects.unlisted import FLOW_GAIN_OF_TIME, FORCE_OF_POSITION, FRICTION_OF_POSITION, NODES

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
