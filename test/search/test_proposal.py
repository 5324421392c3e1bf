"""Sets of effects by linear best-subset selection: on a Gram matrix written by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.model import TriedEffect, start_of
from shake_ros.physics.plant.parameters import INDEX
from shake_ros.search.proposal import EffectTrial, Linearised, evaluate, linearised, proposals
from shake_ros.settings import load_table

RNG = np.random.default_rng(3)


def candidate(name: str, low: float = 0.0) -> TriedEffect:
    strength = FreeParameter(f"effects.{name}.strength", 1.0, low, 10.0, "-")
    return TriedEffect(name, (strength,), (({strength.name: 1.0},),), "valve", scaled=(strength.name,))


def linear(residuals: np.ndarray, directions: dict[str, np.ndarray], low: float = 0.0) -> Linearised:
    trials = tuple(EffectTrial(candidate(n, low), candidate(n).trials[0]) for n in directions)
    d = np.column_stack(list(directions.values()))
    places = tuple((i,) for i in range(len(trials)))
    power, score = d.T @ d, -(d.T @ residuals)
    response, model = np.zeros((0, len(trials))), cast(Any, None)
    return Linearised(trials, places, power, score, response, np.zeros(0), model, float(np.mean(residuals**2)))


def directions(*names: str) -> dict[str, np.ndarray]:
    return {name: RNG.standard_normal(400) for name in names}


def test_two_effects_that_show_only_together_are_proposed_as_a_pair() -> None:
    d = directions("first", "second", "other")
    d["decoy"] = d["first"] + d["second"] + 2.0 * RNG.standard_normal(400)
    found = proposals(linear(-(d["first"] + d["second"]), d))
    assert set(found[2][0].names) == {"first", "second"}
    assert found[2][0].gain == pytest.approx(0.5 * np.sum((d["first"] + d["second"]) ** 2), rel=0.01)
    assert [p[0] for p in found[2][0].parts] == pytest.approx([1.0, 1.0], abs=0.05)


def test_effect_of_one_sign_is_not_proposed_with_the_other() -> None:
    d = directions("backlash")
    assert proposals(linear(d["backlash"], d))[1] == []
    assert proposals(linear(d["backlash"], d, low=-10.0))[1][0].parts[0][0] == pytest.approx(-1.0, abs=0.01)


def test_gain_of_a_set_is_the_fall_of_half_the_sum_of_squares() -> None:
    d = directions("first", "second")
    r = -(0.7 * d["first"] + 0.2 * d["second"]) + RNG.standard_normal(400)
    gain, parts = evaluate(linear(r, d), (0, 1))
    left = r + np.column_stack([d["first"], d["second"]]) @ parts
    assert gain == pytest.approx(0.5 * float(r @ r - left @ left), rel=1e-3)


def test_what_all_of_a_residual_might_be_counts_as_noise_for_a_gain() -> None:
    """Beside residuals ten times as large as the noise an effect that takes a part of chance gains no more nats."""
    d, r = directions("first"), RNG.standard_normal(400)
    quiet, loud = (proposals(linear(size * r, d, low=-1e3).dispersed(), 1)[1][0].gain for size in (1.0, 10.0))
    assert loud == pytest.approx(quiet, rel=0.1)


def test_effect_of_friction_gains_nothing_by_what_the_declared_friction_explains_alone() -> None:
    level = FreeParameter("friction.coulomb_level", 100.0, 0.0, 1e4, "N")
    drag = FreeParameter("effects.quadratic_drag.coefficient", 1.0, 0.0, 1e3, "N*s^2/m^2")
    effect = TriedEffect("quadratic_drag", (drag,), (({drag.name: 1.0},),), "friction", scaled=(drag.name,))
    table = load_table("bergamo")
    bent = start_of(table, (level,)).at(np.zeros(1))  # a fit has made friction nothing
    by_friction, by_drag, noise = RNG.standard_normal((3, 400))

    def proposed(strength: float) -> list[Any]:
        def residuals(vectors: np.ndarray) -> np.ndarray:
            acts = (vectors[:, INDEX[level.name]] / table.value(level.name))[:, None] ** 2
            shows = acts * vectors[:, INDEX[drag.name]][:, None]
            return 0.1 * noise + (1.0 - acts) * by_friction + (strength - shows) * by_drag

        data = SimpleNamespace(residuals=residuals, difference=1e-4, count=400, run_sizes=lambda: [400])
        data.part = lambda seconds: data
        return proposals(linearised(SimpleNamespace(model=bent, prediction=data), [effect]), 1)[1]

    assert sum(p.gain for p in proposed(0.0)) < 1.0
    assert proposed(1.0)[0].gain == pytest.approx(0.5 * float(by_drag @ by_drag), rel=0.05)


def test_effect_beyond_the_bound_of_a_parameter_is_proposed() -> None:
    """A dead band is an underlap below nothing: where the fit has made that nothing, only the effect is left."""
    underlap = FreeParameter("valve.underlap", 0.01, 0.0, 0.1, "-")
    band = FreeParameter("effects.spool_deadband.width", 0.01, 0.0, 0.2, "-")
    effect = TriedEffect("spool_deadband", (band,), (({band.name: 0.01},),), "valve", scaled=(band.name,))
    table, (shows, noise) = load_table("bergamo"), RNG.standard_normal((2, 400))

    def proposed(fitted: float) -> list[Any]:
        def residuals(vectors: np.ndarray) -> np.ndarray:
            width = vectors[:, INDEX[band.name]] - vectors[:, INDEX[underlap.name]] + fitted
            return 0.1 * noise + (width[:, None] / 0.01 - 1.0) * shows

        data = SimpleNamespace(residuals=residuals, difference=1e-4, count=400, run_sizes=lambda: [400])
        data.part = lambda seconds: data
        model = start_of(table, (underlap,)).at(np.array([fitted / underlap.scale]))
        return proposals(linearised(SimpleNamespace(model=model, prediction=data), [effect]), 1)[1]

    assert sum(p.gain for p in proposed(0.03)) < 1.0
    assert proposed(0.0)[0].gain == pytest.approx(0.5 * float(shows @ shows), rel=0.05)


def test_effect_is_not_proposed_below_its_least_strength() -> None:
    d = directions("lag")
    r = -0.5 * d["lag"]
    assert proposals(linear(r, d))[1][0].parts[0][0] == pytest.approx(0.5, abs=0.01)
    shortest = proposals(linear(r, d, low=0.9))[1][0]
    assert shortest.parts[0][0] == pytest.approx(0.9)
    assert shortest.gain == pytest.approx((0.5 * 0.9 - 0.5 * 0.9**2) * float(d["lag"] @ d["lag"]), rel=0.01)
