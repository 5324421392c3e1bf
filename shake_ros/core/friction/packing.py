"""One record for every friction law: the laws' fields by name, and the number of the law.

A law's parameters stand in the fields of their names (`coulomb_level`, `viscous`, …), a field that the law does not
have is zero, and `kind` tells which law reads them. So a table's record is the same whatever law it uses, and
compiled code is compiled once.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from shake_ros.core.friction import FRICTIONS
from shake_ros.core.friction.law import FrictionLaw
from shake_ros.core.quantities import quantity


@dataclasses.dataclass(frozen=True)
class _Kind:
    kind: float = quantity("-", "number of the friction law", low=0.0)


def friction_fields() -> dict[str, dataclasses.Field[Any]]:
    """Every field that any law has, by name, with the first law's metadata; the law's number `kind` at the end."""
    fields: dict[str, dataclasses.Field[Any]] = {}
    for law in FRICTIONS.values():
        for field in dataclasses.fields(law):
            fields.setdefault(field.name, field)
    return fields | {"kind": dataclasses.fields(_Kind)[0]}


FRICTION_FIELDS = friction_fields()
NAMES_OF_CODES = {law.code: name for name, law in FRICTIONS.items()}


def name_of(law: FrictionLaw) -> str:
    """The law's name in FRICTIONS."""
    return NAMES_OF_CODES[law.code]


def field_value(law: FrictionLaw, name: str) -> float:
    """Value of one of FRICTION_FIELDS for a law: zero where the law does not have it."""
    return float(law.code) if name == "kind" else float(getattr(law, name, 0.0))


def friction_record(law: FrictionLaw) -> Any:
    """The law alone as a record that the kernels of this folder take."""
    dtype = np.dtype([(f"friction_{name}", "f8") for name in FRICTION_FIELDS])
    values = tuple(field_value(law, name) for name in FRICTION_FIELDS)
    return np.array([values], dtype=dtype).view(np.recarray)[0]
