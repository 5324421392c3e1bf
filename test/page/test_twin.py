"""What the page keeps of the twin: curves in readable units, changes, and nothing of a reference that is being made."""

from __future__ import annotations

import pytest

from shake_ros.page.desk import MOST, TwinHistory, TwinStatus

LEAKAGE = "leakage.internal"


def window(state: str = "watching", leakage: float = 1e-11, *changes: TwinStatus) -> list[TwinStatus]:
    values = {"value": str(leakage), "low": str(0.9 * leakage), "high": str(1.1 * leakage), "unit": "m^3/(s*Pa)"}
    return [
        TwinStatus("table", 0, state, {"state": state}),
        TwinStatus(LEAKAGE, 0, "0.60 (0.54 … 0.66) L/(min·MPa)", values),
        *changes,
    ]


def test_a_parameter_is_a_curve_with_its_band_in_the_unit_to_read_it_in() -> None:
    history = TwinHistory()
    history.add(2.0, window(leakage=1e-11))
    history.add(4.0, window(leakage=2e-11))
    (curve,) = history.content["parameters"]
    assert history.content["time"] == [2.0, 4.0]
    assert (curve["name"], curve["unit"]) == (LEAKAGE, "L/(min·MPa)")
    assert curve["value"] == pytest.approx([0.6, 1.2])
    assert curve["low"] == pytest.approx([0.54, 1.08])
    assert curve["high"] == pytest.approx([0.66, 1.32])


def test_a_change_says_what_since_when_and_how_bad() -> None:
    history = TwinHistory()
    values = {"since": "3500000000", "change": f"{LEAKAGE} × 2.00 (1.90 … 2.10)", "action": "check the seals"}
    history.add(6.0, window("watching", 2e-11, TwinStatus("change 1", 1, "", values)))
    (change,) = history.content["changes"]
    assert change == {**values, "since": 3.5, "level": 1}


def test_a_twin_that_makes_a_reference_shows_nothing_of_what_another_found_before() -> None:
    history = TwinHistory()
    history.add(2.0, window())
    history.add(4.0, window("learning"))
    assert history.content == {"time": [], "parameters": [], "changes": []}
    history.add(6.0, window())
    assert history.content["time"] == [6.0]


def test_hours_stay_in_view_with_a_bounded_number_of_windows() -> None:
    history, count = TwinHistory(), 5 * MOST
    for k in range(count):
        history.add(2.0 * k, window(leakage=(1 + k) * 1e-13))
    time, (curve,) = history.content["time"], history.content["parameters"]
    assert time[0] == 0.0
    assert time[-1] == 2.0 * (count - 1)
    assert MOST // 2 <= len(time) <= MOST
    assert curve["value"] == pytest.approx([0.006 * (1 + t / 2) for t in time], rel=1e-5)
