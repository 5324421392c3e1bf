"""Where a refit begins."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from shake_ros.core.discovery.refit import best_start
from shake_ros.core.discovery.screening import ScreenedTrial
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import load_table


def test_a_refit_does_not_begin_from_nothing_where_no_other_parameter_has_a_slope() -> None:
    (candidate,) = (c for c in effect_candidates() if c.effect == "specimen_resonance")
    free = FreeParameters(load_table("bergamo"), list(free_parameters()))
    column = list(free.base.fields).index("effects.specimen_resonance.mass")
    problem: Any = SimpleNamespace(residuals=lambda vectors: vectors[:, [column]])  # the lighter the better
    x = free.start()
    current: Any = SimpleNamespace(free=free, x=x)
    trials = [ScreenedTrial(candidate, i, 0.1, part, x) for i, part in ((4, 2.0), (0, 0.0))]
    found, start = best_start(problem, current, trials, (0.25, 1.0))
    assert found.table(start).value("effects.specimen_resonance.mass") == pytest.approx(0.25 * 30.0)
