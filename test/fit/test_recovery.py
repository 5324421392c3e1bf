"""Parameters of a table of the declared kind, simulated by the independent model, are found again."""

from __future__ import annotations

import pytest
from closed_loops import declared_fit
from hidden_table import TRUE

from shake_ros.fit.uncertainty import estimates


@pytest.mark.parametrize("name", TRUE)
def test_parameter_lies_within_a_few_standard_errors_of_the_truth(name: str) -> None:
    declared, problem = declared_fit("nothing")
    found = {e.name: e for e in estimates(declared, problem.blocks())}[name]
    assert found.std_error is not None
    assert abs(found.value - TRUE[name]) < 4.0 * found.std_error + 1e-3 * TRUE[name]


@pytest.mark.parametrize("name", ["bulk_modulus.modulus", "valve.flow_coefficient"])
def test_what_rules_the_motion_is_found_within_half_a_per_cent(name: str) -> None:
    declared, problem = declared_fit("nothing")
    found = {e.name: e for e in estimates(declared, problem.blocks())}[name]
    assert found.value == pytest.approx(TRUE[name], rel=0.005)
    assert found.std_error is not None
    assert found.std_error < 0.005 * TRUE[name]
