"""What another search has found, made a selection: an effect whose parameters a fit drops is gone."""

from __future__ import annotations

from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.search.answer import effects_tried
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.candidates import function, listed
from shake_ros.search.decision import absent_on
from shake_ros.search.problem import ModelStructure
from shake_ros.search.unlisted_functions import OF_MOTION
from shake_ros.settings import load_table


def test_effect_is_absent_where_its_parameters_are_not_free_and_as_found_where_they_are() -> None:
    known = {c.effect: c for c in effect_candidates()}
    effect = known["specimen_resonance"]
    values = {"mass": 120.0, "frequency": 5.0, "damping": 0.03}
    found = load_table("bergamo").with_values({f"effects.specimen_resonance.{n}": v for n, v in values.items()})
    base = absent_on(found, [effect], found)
    assert base.value("effects.specimen_resonance.mass") == 0.0
    free = FreeParameters(base, effect.free)
    again = free.table(free.x_of({p.name: found.value(p.name) for p in effect.free}))
    assert [again.value(p.name) for p in effect.free] == [found.value(p.name) for p in effect.free]
    assert listed(effect).name == "specimen_resonance"


def test_function_keeps_its_quantity_and_range_without_its_nodes() -> None:
    made = function(OF_MOTION[0], -0.02, 0.03)
    values = {**made.trials[0][0], made.free[3].name: 40.0}
    found = load_table("bergamo").with_values(values)
    effect = CandidateEffect("unlisted", made.free, (), "force", ())
    base = absent_on(found, [effect], found)
    assert base.value("effects.unlisted.kind") == found.value("effects.unlisted.kind") == 1
    assert base.value("effects.unlisted.high") == 0.03
    assert all(base.value(p.name) == 0.0 for p in made.free)


def test_an_effect_that_showed_is_tried_at_the_values_of_its_first_fit() -> None:
    known = {c.effect: c for c in effect_candidates()}
    table, effect = load_table("bergamo"), known["specimen_resonance"]
    values = {f"effects.specimen_resonance.{n}": v for n, v in (("mass", 80.0), ("frequency", 7.49), ("damping", 1e-3))}
    model = ModelStructure(table, free_parameters(), candidates=(effect,))
    (plain,) = effects_tried(model, [], slow=False)
    shown = ModelStructure(table, model.free, (), (effect,), fitted=table.with_values(values), shown=(effect.effect,))
    (tried,) = effects_tried(shown, [], slow=False)
    assert tried.trials == (*plain.trials, (values,))
