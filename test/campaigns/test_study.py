"""Study files: what they say, and a line each for what they must not."""

from __future__ import annotations

import copy

import pytest

from shake_ros.campaigns.study import content_hash, load_study, study_of
from shake_ros.quantities import ShakeError
from shake_ros.settings import config_folder

GOOD = {
    "title": "Sums",
    "measure": "benchmarks.campaign.tasks:sums",
    "rows": [{"seed": {"first": 1, "last": 3}, "size": [10, 20]}, {"seed": [3, 7], "size": [20]}],
    "report": [{"shares": ["even"], "by": ["size"]}],
}


def study(changes=None, **keys):
    return study_of(copy.deepcopy({**GOOD, **keys}), "sums", "sums.yaml", changes or {})


def test_rows_are_the_products_of_the_blocks_in_order_each_once():
    rows = [(row["seed"], row["size"]) for row in study().rows()]
    assert rows == [(1, 10), (1, 20), (2, 10), (2, 20), (3, 10), (3, 20), (7, 20)]


def test_by_chance_the_order_is_another_and_always_the_same():
    one, two = (list(study(order="chance").rows()) for _ in range(2))
    listed = list(study().rows())
    assert one == two != listed
    assert sorted(map(str, one)) == sorted(map(str, listed))


def test_what_is_the_same_in_every_row_is_overruled_by_a_block():
    rows = list(study(same={"size": 5}, rows=[{"seed": [1]}, {"seed": [1], "size": [6]}]).rows())
    assert rows == [{"seed": 1, "size": 5}, {"seed": 1, "size": 6}]


def test_values_can_be_changed_by_their_names():
    assert {row["size"] for row in study({"size": 30}).rows()} == {30}
    assert [row["seed"] for row in study({"seed": {"first": 8, "last": 9}, "size": [1]}).rows()] == [8, 9]


def test_the_key_follows_values_code_and_content_of_files(tmp_path):
    file = tmp_path / "run"
    file.write_text("a")
    one = study(
        measure="benchmarks.campaign.tasks:labelled", files=["file"], rows=[{"file": [str(file)], "seed": [1, 2]}]
    )
    first, second = one.rows()
    keys = {one.key(first, "v1"), one.key(second, "v1"), one.key(first, "v2")}
    file.write_text("b")
    assert len(keys | {one.key(first, "v1")}) == 4
    file.write_text("a")
    assert one.key(first, "v1") in keys


def test_the_content_of_a_folder_is_that_of_its_files_with_their_names(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "data").write_text("same")
    assert content_hash(tmp_path / "a") == content_hash(tmp_path / "b")
    (tmp_path / "b" / "data").rename(tmp_path / "b" / "other")
    assert content_hash(tmp_path / "a") != content_hash(tmp_path / "b")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"titel": "x"}, "unknown key 'titel'"),
        ({"title": 3}, "title: 3 is not a text"),
        ({"rows": []}, "rows: is not a list of blocks"),
        ({"rows": [3]}, "rows: 1: is not a mapping"),
        ({"rows": [{"seed": 3}]}, "neither a list of values nor first and last"),
        ({"rows": [{"seed": []}]}, "neither a list of values nor first and last"),
        ({"rows": [{"seed": {"first": 3, "last": 1}}]}, "not rising whole numbers"),
        ({"rows": [{"seed": {"first": 3}}]}, "missing last"),
        ({"rows": [{"sed": [3]}]}, "row 1: missing a required argument: 'seed'"),
        ({"rows": [{"seed": [3], "colour": [1]}]}, "unexpected keyword argument 'colour'"),
        ({"rows": [{"seed": [float("nan")]}]}, "neither number, text"),
        ({"rows": [{"list": "benchmarks.campaign.tasks:nobody"}]}, "list: .* is not a function"),
        ({"rows": [{"list": "benchmarks.campaign.tasks:nothing", "with": {"a": 1}}]}, "with: .*argument"),
        ({"measure": "benchmarks.campaign.tasks"}, "measure: .* is not a function"),
        ({"measure": "nowhere.at.all:sums"}, "measure: .* is not a function"),
        ({"files": ["sed"]}, "files: no row has a value 'sed'"),
        (
            {
                "measure": "benchmarks.campaign.tasks:labelled",
                "files": ["file"],
                "rows": [{"seed": [1], "file": ["a/b"]}],
            },
            "file: a/b does not exist",
        ),
        ({"order": "backwards"}, "unknown order 'backwards'"),
        ({"files": "seed"}, "files: is not a list"),
        ({"report": [{"rates": ["even"]}]}, "report: 1: is not a mapping with one of the keys"),
        ({"report": [{"shares": ["even"], "colour": 1}]}, "unknown key 'colour'"),
        ({"report": [{"matrix": {"truth": "seed"}}]}, "missing named"),
        ({"report": {"shares": ["even"]}}, "report: is not a list"),
    ],
)
def test_a_study_that_cannot_be_is_one_line(keys, said):
    with pytest.raises(ShakeError, match=said) as caught:
        study(**keys)
    assert str(caught.value).startswith("sums.yaml: ")


def test_unknown_changes_list_what_there_is():
    with pytest.raises(ShakeError, match=r"unknown value 'sed'.*known: seed, size"):
        study({"sed": 3})


def test_a_list_in_the_place_of_the_one_value_of_every_row_is_refused():
    with pytest.raises(ShakeError, match=r"size: \[5\] is a list"):
        study({"size": [5]}, same={"size": 5}, rows=[{"seed": [1]}])


@pytest.mark.parametrize("path", sorted((config_folder() / "studies").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_study_of_the_package_can_be_read(path):
    assert next(load_study(path.stem).rows())
