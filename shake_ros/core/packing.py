"""One record for all members of a family: their fields by name, and the member's number `kind`.

A member's parameters stand in the fields of their names; a field that it does not have is zero; `kind` tells
compiled code which member reads them. So a table's record is the same whatever law or valve it uses, and one
compilation serves all. A member is a `Parameters` class with a class constant `code`, the number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from shake_ros.core.quantities import Parameters, quantity


@dataclasses.dataclass(frozen=True)
class _Kind:
    kind: float = quantity("-", "number of the member that is used", low=0.0)


def union_fields(family: Mapping[str, type[Parameters]]) -> dict[str, dataclasses.Field[Any]]:
    """Every field that any member has, by name, with the first member's metadata; `kind` at the end."""
    fields: dict[str, dataclasses.Field[Any]] = {}
    for member in family.values():
        for field in dataclasses.fields(member):
            fields.setdefault(field.name, field)
    return fields | {"kind": dataclasses.fields(_Kind)[0]}


def name_of(family: Mapping[str, type[Parameters]], member: Parameters) -> str:
    """The member's name in its family."""
    return next(name for name, cls in family.items() if cls is type(member))


def field_value(member: Parameters, name: str) -> float:
    """Value of one of `union_fields` for a member: zero where it does not have it."""
    return float(type(member).code if name == "kind" else getattr(member, name, 0.0))  # type: ignore[attr-defined]


def record(prefix: str, family: Mapping[str, type[Parameters]], member: Parameters) -> Any:
    """The member alone as a record with fields prefix_name, as the kernels of its family take it."""
    names = list(union_fields(family))
    dtype = np.dtype([(f"{prefix}_{name}", "f8") for name in names])
    return np.array([tuple(field_value(member, name) for name in names)], dtype=dtype).view(np.recarray)[0]
