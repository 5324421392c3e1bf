"""The functions that are written from a family's table: complete, cached, and open to a new member by one row."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from shake_ros.compiled import njit
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.packing import dispatch, field_value, having, kernel_of, layout, numbers, record, records, union_fields
from shake_ros.physics.bulk_modulus import BULK_MODULI
from shake_ros.physics.friction import FRICTIONS
from shake_ros.physics.friction.law import FIRST_DYNAMIC, FrictionLaw
from shake_ros.quantities import Parameters, choice, quantity

ROOT = Path(__file__).resolve().parents[1]
NEEDED = {
    "controller": (CONTROLLERS, ("feedforward", "step")),
    "observer": (OBSERVERS, ("observe",)),
    "bulk modulus": (BULK_MODULI, ("bulk_modulus",)),
}


@dataclass(frozen=True)
class Quadratic(FrictionLaw):
    """A law that this test adds: one file and one row."""

    code: ClassVar[int] = 9
    has_memory: ClassVar[bool] = True

    drag: float = quantity("N*s^2/m^2", "drag", low=0.0, high=1e6)


@njit
def curve_level(p, velocity):
    return p.friction_drag * velocity * velocity


@dataclass(frozen=True)
class Steeper(Quadratic):
    """A law that takes its kernel from the one it derives from."""

    code: ClassVar[int] = 8


@pytest.mark.parametrize("family", NEEDED)
def test_every_member_has_a_number_of_its_own_and_the_kernels_of_its_family(family: str) -> None:
    members, kernels = NEEDED[family]
    assert len({member.code for member in members.values()}) == len(members)
    for name, member in members.items():
        for kernel in kernels:
            assert kernel_of(member, kernel) is not None, f"{name} has no {kernel}"


def test_every_friction_law_has_a_number_and_a_curve_or_a_contact() -> None:
    assert len({law.code for law in FRICTIONS.values()}) == len(FRICTIONS)
    for name, law in FRICTIONS.items():
        dynamic = law.code >= FIRST_DYNAMIC
        wanted = ("contact_level", "contact_deflection") if dynamic else ("curve_level",)
        assert name == "none" or all(kernel_of(law, kernel) is not None for kernel in wanted), name
        assert not law.has_memory or (kernel_of(law, "memory_rate") and kernel_of(law, "steady_memory")), name


def test_a_new_law_is_one_file_and_one_row() -> None:
    family = {**FRICTIONS, "quadratic": Quadratic, "steeper": Steeper}
    level = dispatch(__name__, family, "curve_level", "p.friction_kind", "0.0", name="level_of_all")
    remembers = having(__name__, family, "has_memory", "p.friction_kind")
    for law, expected in ((Quadratic(300.0), 12.0), (Steeper(500.0), 20.0), (FRICTIONS["none"](), 0.0)):
        p = record("friction", family, law)
        assert level(p, 0.2) == pytest.approx(expected)
        assert remembers(p) == law.has_memory


def test_what_is_written_is_taken_from_the_cache_by_the_next_process() -> None:
    program = (
        "from shake_ros.control.laws.runner import feedforward_law as f\n"
        "from shake_ros.control.laws import CONTROLLERS\n"
        "from shake_ros.packing import records\n"
        "import numpy as np\n"
        "law = CONTROLLERS['none'](limit=1.0, start_time=0.0, model_bandwidth=9.0, model_horizon=0.1)\n"
        "f(records(CONTROLLERS, law)[0], np.zeros(3))\n"
        "print(sum(f.stats.cache_hits.values()), sum(f.stats.cache_misses.values()))\n"
    )
    for _ in range(2):
        ran = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["1", "0"]


@dataclass(frozen=True)
class Named(Parameters):
    """A choice, a text and what is computed once."""

    code: ClassVar[int] = 3
    derived: ClassVar[tuple[str, ...]] = ("twice",)

    gain: float = quantity("-", "gain", low=0.0, high=9.0)
    place: str = choice("where", ("inner", "outer"))
    table: str = choice("any text")


def test_a_record_holds_numbers_choices_and_what_is_derived() -> None:
    family = {"named": Named}
    made = records(family, Named(2.0, "outer", "bergamo"), "x_", {"twice": 4.0})
    assert layout(family).names == ("gain", "place", "kind", "twice")
    assert made.dtype.names == ("x_gain", "x_place", "x_kind", "x_twice")
    assert made[0].tolist() == (2.0, 1.0, 3.0, 4.0)
    assert "table" not in union_fields(family)
    assert field_value(Named(2.0, "inner", "bergamo"), "place") == 0.0
    assert layout(family) is layout(family)
    assert numbers(Quadratic(5.0)).dtype == np.dtype([("drag", "f8")])
