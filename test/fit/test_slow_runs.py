"""Slow runs on a table with backlash that the package did not simulate: they find its gap where a predictor stays."""

from __future__ import annotations

import numpy as np
import pytest

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import FreeModel, start_of
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.segment import Segment
from shake_ros.fit.slow_runs import SlowRuns
from shake_ros.fit.solver import Budget, fit
from shake_ros.search.candidates import listed

GAP = "effects.coupling_backlash.gap"
TRUTH = hidden.declared_truth(5)._replace(coupling_backlash=1.2e-4)
STILL = Levels(force=3.0, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)
FREE = Levels(force=1e-4, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)


@pytest.fixture(scope="module")
def segment() -> Segment:
    name, commands = next(iter(hidden.excitations(5, 0.5).items()))
    made = hidden.record(TRUTH, commands, 1.0, np.random.default_rng(5))
    times = hidden.SAMPLE * np.arange(len(commands))
    (record,) = sr.recording(
        name, times, made["command"], made["position"], acceleration=made["acceleration"]
    ).records()
    return Segment.of(record.part(slice(300, 3300)))


def beside(factor: float) -> FreeModel:
    """The table with a gap so many times its own."""
    declared = sr.model("full")
    table = declared.table.with_values({n: getattr(TRUTH, field) for n, field in hidden.DECLARED.items()})
    (backlash,) = (listed(c) for c in effect_candidates(declared.declared, table) if c.effect == "coupling_backlash")
    own = {GAP: factor * TRUTH.coupling_backlash, "effects.coupling_backlash.stiffness": TRUTH.contact_stiffness}
    own["effects.coupling_backlash.rod_mass"] = TRUTH.rod_mass
    return start_of(table, free_parameters()).with_effect(backlash, own)


@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_slow_runs_find_a_gap_that_a_predictor_does_not(segment: Segment, factor: float) -> None:
    slow = fit([SlowRuns([segment], FREE)], beside(factor), Budget(), steps=20).model.value(GAP)
    followed = fit([Predictor([segment], STILL)], beside(factor), Budget(), steps=8).model.value(GAP)
    print(f"gap from {factor:g}: {slow / TRUTH.coupling_backlash:.3f}, {followed / TRUTH.coupling_backlash:.3f} times")
    assert slow == pytest.approx(TRUTH.coupling_backlash, rel=0.06)
    assert abs(followed - TRUTH.coupling_backlash) > 0.3 * TRUTH.coupling_backlash
