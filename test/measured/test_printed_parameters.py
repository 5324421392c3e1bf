"""Table 6.9 in the names of a table."""

from __future__ import annotations

from math import tanh
from pathlib import Path

import numpy as np
import pytest
import yaml

from shake_ros.measured.harmonics import HarmonicProblem, HarmonicRun, PrintedParameters, account
from shake_ros.physics.bulk_modulus.ifas import mixture
from shake_ros.physics.effects.hydraulics import factor
from shake_ros.settings import find, load_table, read_yaml

COLUMNS = {k: PrintedParameters.from_mapping(v, k) for k, v in read_yaml(find("measured", "printed")).items()}


def ifas(p: float, c: PrintedParameters) -> float:
    """Tangent modulus from a numerical derivative of the mixture's volume, apart from the package's own form."""

    def volume(pressure: float) -> float:
        liquid = (1.0 + c.slope * (pressure - c.reference_pressure) / c.modulus) ** (-1.0 / c.slope)
        return (1.0 - c.air_fraction) * liquid + c.air_fraction * (c.reference_pressure / pressure) ** (
            1.0 / c.polytropic_exponent
        )

    step = 1e-4 * p
    return -volume(p) * 2.0 * step / (volume(p + step) - volume(p - step))


@pytest.mark.parametrize("name", COLUMNS)
@pytest.mark.parametrize("p_a", [1.0e6, 5.0e6, 1.0e7, 2.0e7])
def test_stiffness_is_that_of_the_printed_equations(name: str, p_a: float) -> None:
    c, values = COLUMNS[name], COLUMNS[name].values()
    for load in (0.0, 5.0e5, 9.177e5, 3.0e6, -3.0e6):
        printed = ifas(p_a, c) * (
            c.lambda_1
            - c.lambda_2 * (tanh(c.sharpness * (load + c.threshold)) - tanh(c.sharpness * (load - c.threshold)))
        )
        own = mixture(
            p_a,
            values["bulk_modulus.modulus"],
            values["effects.pressure_dependent_bulk_modulus.slope"],
            values["effects.entrained_air.fraction"],
            values["effects.entrained_air.polytropic_exponent"],
            values["bulk_modulus.reference_pressure"],
        ) * factor(load, *(values[f"effects.soft_zone.{part}"] for part in ("depth", "threshold", "sharpness")))
        assert own == pytest.approx(printed, rel=0.01)


def test_friction_at_rest_and_its_slope_are_the_printed_ones() -> None:
    values = COLUMNS["with_soft_zone"].values()
    assert values["friction.coulomb_level"] + values["friction.stribeck_rise"] == pytest.approx(1254.16)
    assert values["friction.stribeck_decay"] == pytest.approx(1.0 / 0.014)


def test_printed_numbers_are_those_of_the_measured_folder(shared: Path) -> None:
    other = yaml.safe_load((shared / "spec" / "parameters.yaml").read_text(encoding="utf-8"))["table_6_9_bulk"]
    for key, column in (("with_soft_zone", other["modified_ifas"]), ("without_soft_zone", other["ifas"])):
        c = COLUMNS[key]
        assert (c.coulomb_force, c.static_force, c.viscous) == (column["fc"], column["fs"], column["fv"])
        assert (c.internal_leakage, c.external_leakage) == (float(column["c_il"]), float(column["c_el"]))
        assert c.reference_pressure == pytest.approx(1e5 * column["p0_bar"])
        assert (c.slope, c.air_fraction) == (column["m"], float(column["alpha"]))


def test_printed_parameters_miss_the_runs_as_far_as_an_independent_model_does(shared: Path) -> None:
    other = yaml.safe_load((shared / "measured" / "harmonics.yaml").read_text(encoding="utf-8"))
    content = read_yaml(find("measured", "harmonics"))
    problem = HarmonicProblem([HarmonicRun(**entry) for entry in content["runs"]])
    table = load_table("bergamo").with_values(COLUMNS["with_soft_zone"].values())
    result = account(problem, table.vector())
    assert result.rms == pytest.approx(other["reference_fit_rms"]["modified_ifas_printed_parameters"], rel=0.1)
    fundamentals = np.array([span.start for span in problem.spans])
    assert result.amplitudes[fundamentals] == pytest.approx(problem.measured[fundamentals], rel=0.04)
