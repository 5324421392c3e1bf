"""A specimen is a part of the moved mass, also where a fit moves that mass."""

from dataclasses import replace

import numpy as np
import pytest

from shake_ros.declared import effect_candidates, free_parameters, load_table, sized
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters

SPECIMEN = "effects.specimen_resonance.mass"
MASS = FreeParameter("body.table_mass", 20.0, 10.0, 1e5, "kg")


@pytest.fixture(scope="module")
def free() -> FreeParameters:
    """A table and the mass of the specimen that it carries, both free."""
    table = load_table("bergamo").with_values({"body.specimen_mass": 0.0, SPECIMEN: 150.0})
    candidate = next(c for c in sized(effect_candidates(), table) if c.effect == "specimen_resonance")
    return FreeParameters(table, [MASS, candidate.strength])


def test_a_heavier_table_carries_a_heavier_specimen(free: FreeParameters) -> None:
    x = free.start() * [4.0, 1.0]
    assert free.table(x).value(SPECIMEN) == pytest.approx(600.0)
    assert free.vectors(x)[0, free.columns] == pytest.approx([4.0 * 450.0, 600.0])


def test_no_specimen_weighs_more_than_all_that_moves(free: FreeParameters) -> None:
    for mass in (free.low[0], 50.0, free.high[0]):
        moved, swaying = free.values(np.array([mass, free.high[1]]))
        assert swaying < 0.95 * moved


def test_values_lead_back_to_themselves(free: FreeParameters) -> None:
    wanted = {"body.table_mass": 1234.0, SPECIMEN: 321.0}
    assert dict(zip(free.names, free.values(free.x_of(wanted)), strict=True)) == pytest.approx(wanted)
    other = FreeParameters(free.base.with_values(wanted), free.free)
    assert other.values(free.x_of(wanted)) == pytest.approx(list(wanted.values()))


def test_slopes_are_those_of_the_values(free: FreeParameters) -> None:
    x = free.start()
    differences = [(free.values(x + h) - free.values(x - h)) / 2e-3 for h in 1e-3 * np.eye(len(x))]
    assert free.slopes(x) == pytest.approx(np.array(differences).T)


def test_where_the_moved_mass_is_known_a_specimen_counts_in_kilograms() -> None:
    table = load_table("bergamo")
    kept = [p for c in effect_candidates() for p in c.free if p.name == SPECIMEN]
    (sized_one,) = (p for c in sized(effect_candidates(), table) for p in c.free if p.name == SPECIMEN)
    assert replace(sized_one, moved_mass=0.0) == kept[0]
    free = FreeParameters(table, [*free_parameters(), sized_one])
    assert free.x_of({SPECIMEN: 100.0})[-1] * sized_one.scale == pytest.approx(100.0)
