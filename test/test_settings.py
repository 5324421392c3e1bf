"""A YAML file that is not what it should be is one clear line that names it."""

from __future__ import annotations

from pathlib import Path

import pytest

from shake_ros.quantities import ShakeError, check, shown, unknown_name
from shake_ros.settings import load_variant, read_yaml

NUMBER = {"unit": "m", "low": 0.0, "high": 1.0}
LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n" for old, new in zip("abcdefg", "bcdefgh", strict=True)
)


def refused(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ShakeError) as error:
        read_yaml(path)
    return str(error.value)


@pytest.mark.parametrize(
    "value",
    [
        "!!int ''",
        "!!float ''",
        "!!bool x",
        "!!timestamp x",
        "2001-02-30",
        "[" * 5000,
        "!!binary é",
        "!!python/name:os.x",
    ],
)
def test_a_value_that_its_tag_does_not_fit_is_no_valid_yaml(tmp_path, value) -> None:
    said = refused(tmp_path / "file.yaml", f"name: {value}")
    assert said.startswith(f"{tmp_path}/file.yaml: not valid YAML: ")
    assert "\n" not in said


def test_aliases_that_blow_a_document_up_are_refused(tmp_path) -> None:
    assert "aliases blow it up" in refused(tmp_path / "file.yaml", LAUGHS)


def test_an_alias_that_holds_itself_is_refused(tmp_path) -> None:
    assert "not valid YAML" in refused(tmp_path / "file.yaml", "a: &a [*a]")


def test_plain_aliases_are_read(tmp_path) -> None:
    (tmp_path / "file.yaml").write_text("a: &a [1, 2]\nb: *a")
    assert read_yaml(tmp_path / "file.yaml") == {"a": [1, 2], "b": [1, 2]}


@pytest.mark.parametrize(
    "value",
    [10**400, -(10**400), 16**6000, float("inf"), float("nan"), True, "1", [[1] * 99] * 99],
    ids=range(8),
)
def test_what_is_no_finite_number_is_shown_in_short(value) -> None:
    with pytest.raises(ShakeError, match=r"^name = .* is not a finite number$") as error:
        check("name", value, NUMBER, float)
    assert len(str(error.value)) < 200


def test_a_long_name_with_a_line_end_is_cut_and_stays_on_one_line() -> None:
    said = str(unknown_name("parameter", "a\nb" * 2000, ["alpha", "beta"]))
    assert "\n" not in said
    assert len(said) < 200


def test_shown_is_short_whatever_the_value() -> None:
    assert (
        max(len(shown(value)) for value in ("a" * 10_000, 16**6000, list(range(10_000)), {k: k for k in range(999)}))
        < 200
    )


def test_a_kind_that_is_a_list_is_refused(tmp_path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text("kind: [1]")
    with pytest.raises(ShakeError, match=r"file\.yaml: "):
        load_variant("controller", str(path), {})
