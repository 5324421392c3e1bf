"""Perturbed tables: within their bounds, the same for the same seed, groups moved together."""

from __future__ import annotations

import pytest

from shake_ros.api.loops import DEAD_TIME, GROUPS, Spread, perturbed
from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.quantities import OutOfBounds, ShakeError
from shake_ros.settings import find, load_table, read_yaml


@pytest.fixture(scope="module")
def table() -> TableParameters:
    return load_table("bergamo")


@pytest.fixture(scope="module")
def spread() -> Spread:
    return Spread.from_mapping(read_yaml(find("compare", "default"))["perturbed"]["spread"], "compare")


def test_factors_stay_within_their_bounds_and_fill_them(table: TableParameters, spread: Spread) -> None:
    made = perturbed(table, spread, 60, 3)
    for group, names in GROUPS.items():
        factors = [one.value(names[0]) / table.value(names[0]) for one in made]
        low, high = getattr(spread, f"{group}_low"), getattr(spread, f"{group}_high")
        assert low <= min(factors) < low + 0.15 * (high - low)
        assert high >= max(factors) > high - 0.15 * (high - low)
        for one, factor in zip(made, factors, strict=True):
            assert all(one.value(name) == pytest.approx(factor * table.value(name)) for name in names)
    assert all(0.0 <= one.value(DEAD_TIME) <= 0.002 for one in made)


def test_what_is_in_no_group_stays(table: TableParameters, spread: Spread) -> None:
    moved = {name for names in GROUPS.values() for name in names} | {DEAD_TIME}
    for one in perturbed(table, spread, 2, 3):
        assert all(one.value(name) == table.value(name) for name in FIELDS if name not in moved)


def test_same_seed_means_the_same_tables_however_many(table: TableParameters, spread: Spread) -> None:
    few, many = perturbed(table, spread, 2, 9), perturbed(table, spread, 5, 9)
    assert many[:2] == few
    assert perturbed(table, spread, 2, 10) != few


def test_wrong_spread_is_refused(table: TableParameters, spread: Spread) -> None:
    with pytest.raises(OutOfBounds, match=r"bulk_modulus_low = 1\.2 is outside"):
        spread.replace(bulk_modulus_low=1.2)
    with pytest.raises(ShakeError, match=r"delay_low = 0\.01 is above delay_high = 0\.002"):
        perturbed(table, spread.replace(delay_low=0.01), 1, 1)
