"""The first stages of a fit without a data sheet: friction begins anew once an effect that bent it is there."""

from __future__ import annotations

import pytest

from shake_ros.core.identification.stages import with_friction_of
from shake_ros.declared import unknown_model


def test_friction_of_the_first_guess_counts_per_mass_and_leaves_the_rest() -> None:
    model = unknown_model()
    assert model.table is not None
    guess = model.table.with_values(
        {"body.table_mass": 400.0, "friction.coulomb_level": 40.0, "friction.stribeck_decay": 20.0}
    )
    bent = guess.with_values(
        {
            "body.table_mass": 800.0,
            "friction.coulomb_level": 1e-3,
            "friction.stribeck_decay": 300.0,
            "valve.underlap": 3e-3,
        }
    )
    anew = with_friction_of(guess, bent, model)
    assert anew.value("friction.coulomb_level") == pytest.approx(80.0)
    assert anew.value("friction.stribeck_decay") == 20.0
    assert anew.value("valve.underlap") == 3e-3
