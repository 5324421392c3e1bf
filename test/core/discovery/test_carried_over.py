"""Of two effects that can stand for each other, the second is fitted along a path from the first one's solution."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.cli import fitting
from shake_ros.core.discovery.judging import Attempt
from shake_ros.core.discovery.refits import carried_over, mean_square
from shake_ros.core.identification.fit import fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.settings import load_table

TABLE = load_table("bergamo")
POOL = {c.effect: c for c in fitting.all_candidates("full")}
MASS, TANK = POOL["payload_error"], POOL["tank_back_pressure"]
VISCOUS = next(p for p in fitting.declared_parameters("full") if p.name == "friction.viscous")
NAMES = (VISCOUS.name, MASS.strength.name, TANK.strength.name)
COLUMNS = [list(TABLE.fields).index(name) for name in NAMES]
NOISE, FORCE, INERTIA = np.random.default_rng(3).standard_normal((3, 500))


class OneForTheOther:
    """More mass and more friction, or a back pressure: only the ratio of force to inertia shows."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        viscous, mass, tank = vectors[:, COLUMNS].T
        heavier, weaker = 1.0 + mass / 650.0, 1.0 - tank / 2e7
        rest = np.outer(viscous / weaker / heavier - 500.0, FORCE / 10.0)
        return 0.1 * NOISE + rest + np.outer(heavier / weaker - 1.2, 100.0 * INERTIA)


def fitted(candidate: Any, evaluations: int) -> Attempt:
    free = FreeParameters(TABLE, [VISCOUS, candidate.strength])
    x = free.x_of({VISCOUS.name: 800.0})
    result = fit(OneForTheOther(), free, x, evaluations=evaluations, tolerance=1e-10)
    return Attempt(candidate, result, mean_square(result.residuals), 1.0, 0.5)


@pytest.fixture(autouse=True)
def one_block(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = "shake_ros.core.discovery.refits.held_out_blocks"
    monkeypatch.setattr(blocks, lambda hold, result: np.zeros(1))


def test_the_second_reaches_what_the_first_reaches() -> None:
    hold: Any = OneForTheOther()
    best, early = fitted(MASS, 60), fitted(TANK, 1)
    assert early.learn > 100.0 * best.learn
    carried = carried_over(OneForTheOther(), hold, best, early, 30)
    assert carried.candidate is TANK
    assert carried.fit.free.names == (VISCOUS.name, TANK.strength.name)
    assert carried.fit.free.table(carried.fit.x).value(MASS.strength.name) == MASS.neutral
    assert carried.learn == pytest.approx(best.learn, rel=1e-6)


def test_a_fit_that_is_as_good_stays_as_it_is() -> None:
    hold: Any = OneForTheOther()
    best, done = fitted(MASS, 60), fitted(TANK, 200)
    assert done.learn == pytest.approx(best.learn, rel=1e-6)
    assert carried_over(OneForTheOther(), hold, best, done, 3).learn <= done.learn
