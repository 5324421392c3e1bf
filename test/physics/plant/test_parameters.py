"""A table's numbers: tree, dotted names, vector, record and YAML hold the same; errors name file, key and bounds."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant.parameters import FIELDS, FULL_LAYOUT, INDEX, NAMES, TableParameters, records
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.quantities import OutOfBounds, ShakeError, UnknownName
from shake_ros.settings import config_folder, load_table, save_table

BERGAMO = load_table("bergamo")
TEXT = (config_folder() / "table" / "bergamo.yaml").read_text(encoding="utf-8")


def test_vector_and_record_hold_every_dotted_name() -> None:
    table = BERGAMO.with_values({"effects.soft_zone.depth": 0.3, "valve.gain": 1.5})
    vector = table.vector()
    record = records(vector)[0]
    assert vector.shape == (len(NAMES),)
    for name in NAMES:
        field = name.removeprefix("effects.").replace(".", "_")
        assert vector[INDEX[name]] == table.value(name) == record[field]


def test_record_names_are_unique() -> None:
    assert FULL_LAYOUT.record.names is not None
    assert len(set(FULL_LAYOUT.record.names)) == len(NAMES) == len(FIELDS)


def test_records_of_a_batch_are_its_vectors() -> None:
    vectors = np.array([BERGAMO.vector(), BERGAMO.with_values({"body.specimen_mass": 7.0}).vector()])
    rows = records(vectors)
    assert len(rows) == 2
    assert rows[1].body_specimen_mass == 7.0
    assert rows[0].body_specimen_mass == 200.0


def test_mapping_and_yaml_give_the_same_table_back(tmp_path: Path) -> None:
    table = BERGAMO.with_values({f"effects.{name}.{first(name)}": trial(name) for name in FULL_LAYOUT.effects})
    assert FULL_LAYOUT.table(table.to_mapping(), "here") == table
    save_table(tmp_path / "t.yaml", table, "all effects")
    np.testing.assert_array_equal(load_table(str(tmp_path / "t.yaml")).vector(), table.vector())
    with pytest.raises(ShakeError, match="exists already"):
        save_table(tmp_path / "t.yaml", table, "again")


def first(effect: str) -> str:
    return dataclasses.fields(EFFECTS[effect])[0].name


def trial(effect: str) -> float:
    field = dataclasses.fields(EFFECTS[effect])[0]
    value = 0.1 * min(field.metadata["high"], 1e3)
    return float(math.ceil(value) if field.type == "int" else value)


def test_an_absent_effect_has_its_neutral_values_and_no_entry_in_a_file() -> None:
    assert BERGAMO.value("effects.soft_zone.depth") == 0.0
    assert "effects" not in BERGAMO.to_mapping()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("piston_area: 9.4562e-4", "piston_aera: 9.4562e-4", "unknown parameter 'piston_aera'.*piston_area"),
        ("  piston_area: 9.4562e-4\n", "", "missing piston_area"),
        ("piston_area: 9.4562e-4", "piston_area: 9.4562e-4\n  piston_area: 1.0", "twice"),
        ("piston_area: 9.4562e-4", "piston_area: -1.0", "piston_area = -1 is outside"),
        ("piston_area: 9.4562e-4", "piston_area: .nan", "not a finite number"),
        ("piston_area: 9.4562e-4", "piston_area: wide", "not a finite number"),
        ("position_bits: 16", "position_bits: 16.5", "not a whole number"),
        ("leakage:\n", "seals:\n", "unknown section 'seals'"),
        ("body:\n", "body: [\n", "not valid YAML"),
        ("sensors:\n", "effects: {soft_zon: {depth: 0.5}}\nsensors:\n", "did you mean 'soft_zone'"),
        ("sensors:\n", "effects: {soft_zone: {depth: 5.0}}\nsensors:\n", "effects.soft_zone: depth = 5 is outside"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line_that_names_it(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in TEXT
    path = tmp_path / "wrong.yaml"
    path.write_text(TEXT.replace(old, new), encoding="utf-8")
    with pytest.raises(ShakeError, match=said) as refusal:
        load_table(str(path))
    assert "wrong.yaml" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_table_that_is_not_there_is_named_with_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="bergamo"):
        load_table("bergano")
    with pytest.raises(ShakeError, match="cannot be read"):
        load_table("/nowhere/table.yaml")


def test_changes_are_checked() -> None:
    with pytest.raises(UnknownName, match="did you mean"):
        BERGAMO.with_values({"valve.gian": 1.0})
    with pytest.raises(OutOfBounds, match="slowdown"):
        BERGAMO.with_values({"effects.slow_valve.slowdown": 2.0})
    with pytest.raises(UnknownName):
        BERGAMO.value("effects.nothing.here")


def test_a_section_that_a_layout_lacks_is_no_attribute() -> None:
    assert BERGAMO.body.table_mass == BERGAMO.value("body.table_mass")
    beta = ReducedParameters(beta1=-1600.0, beta2=-30.0, beta3=1000.0, beta4=-2.0, beta5=-10.0)
    with pytest.raises(AttributeError, match="body"):
        _ = TableParameters(REDUCED_LAYOUT, {"dynamics": beta}).body


def test_a_name_may_be_given_by_its_last_part_where_that_is_unique() -> None:
    assert FULL_LAYOUT.changes({"specimen_mass": 200}) == {"body.specimen_mass": 200.0}
    with pytest.raises(ShakeError, match="set: stiffness: could be"):
        FULL_LAYOUT.changes({"stiffness": 1.0})
    with pytest.raises(UnknownName, match=r"set: unknown parameter 'specimen_mas'.*body\.specimen_mass"):
        FULL_LAYOUT.changes({"specimen_mas": 1.0})
