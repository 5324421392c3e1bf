"""The thresholds of the search as their file gives them."""

from __future__ import annotations

from typing import Any

import pytest

from shake_ros.quantities import ShakeError, describe
from shake_ros.search.search_settings import SearchSettings
from shake_ros.settings import find, read_yaml

CONTENT: dict[str, Any] = read_yaml(find("discovery", "search"))


def test_every_threshold_stands_in_the_file_and_has_a_meaning() -> None:
    assert list(CONTENT) == list(describe(SearchSettings))
    assert all(entry["meaning"] for entry in describe(SearchSettings).values())


def test_lists_become_numbers() -> None:
    settings = SearchSettings.from_mapping({**CONTENT, "function_multiples": [1, 3]}, "search.yaml")
    assert settings.function_multiples == (1.0, 3.0)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"function_multiples": 2.0}, "function_multiples: needs a list of numbers"),
        ({"function_multiples": ["much"]}, "is not a finite number"),
        ({"function_multiples": [-0.5]}, "function_multiples = -0.5 is outside"),
        ({"converged": 2.0}, "converged = 2 is outside"),
        ({"most_refit": 2}, "did you mean 'most_refitted'"),
    ],
)
def test_a_wrong_threshold_is_one_line_that_names_the_file(change: dict[str, Any], text: str) -> None:
    with pytest.raises(ShakeError, match=r"search\.yaml") as caught:
        SearchSettings.from_mapping({**CONTENT, **change}, "search.yaml")
    assert text in str(caught.value)


def test_a_missing_threshold_is_told() -> None:
    content = {name: value for name, value in CONTENT.items() if name != "converged"}
    with pytest.raises(ShakeError, match="missing converged"):
        SearchSettings.from_mapping(content, "search.yaml")
