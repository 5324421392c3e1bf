"""One record and one compiled function for all members of a family, by the member's number `kind`.

A member's parameters are in the fields of their names; a field that it does not have is zero; `kind` says
compiled code which member reads them. So a table's record is the same whatever law or valve it uses, and one
compilation serves all. A member is a `Parameters` class with a class constant `code`, the number, and where its kernels
need more than its own fields, `derived`: names of numbers that are computed once. A choice among names counts as its
place among them, free text is left out.

Each member has its kernels in its own file, under the names that the family agrees on. `dispatch` writes what one would
write by hand, a function that asks the record for its number and calls that member's kernel,

    def level(p, velocity):
        if p.friction_kind == 0:
            return of_tustin(p, velocity)
        ...

so that a new member is one file and one row of the table. numba caches such a function like any other, as one of the
file of `module`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from shake_ros.compiled import njit
from shake_ros.quantities import OutOfBounds, Parameters, ShakeError, quantity, unknown_name


@dataclass(frozen=True)
class _Kind:
    kind: float = quantity("-", "number of the member that is used", low=0.0)


def union_fields(family: Mapping[str, type[Parameters]]) -> dict[str, dataclasses.Field[Any]]:
    """Every number that any member has, by name, with the first member's metadata; `kind` at the end."""
    fields: dict[str, dataclasses.Field[Any]] = {}
    for member in family.values():
        for field in dataclasses.fields(member):
            if field.metadata.get("names", True):
                fields.setdefault(field.name, field)
    return fields | {"kind": dataclasses.fields(_Kind)[0]}


def name_of(family: Mapping[str, type[Parameters]], member: Parameters) -> str:
    """The member's name in its family."""
    return next(name for name, cls in family.items() if cls is type(member))


def refuse_mismatch(
    what: str, kind: str, parameters: Parameters, family: Mapping[str, type[Parameters]], sample_time: float
) -> None:
    """ShakeError for an unknown kind, parameters of another one, or a sample time [s] that is not positive."""
    if kind not in family:
        raise unknown_name(what, kind, family)
    if not isinstance(parameters, family[kind]):
        raise ShakeError(f"{what} '{kind}' cannot use {type(parameters).__name__}")
    if not (math.isfinite(sample_time) and sample_time > 0.0):
        raise OutOfBounds(f"sample_time = {sample_time!r} is not a positive number")


def field_value(member: Parameters, name: str) -> float:
    """Value of one of `union_fields` for a member: zero where it does not have it."""
    if name == "kind":
        return float(type(member).code)  # type: ignore[attr-defined]
    value = getattr(member, name, 0.0)
    if isinstance(value, str):
        names = next(f.metadata["names"] for f in dataclasses.fields(member) if f.name == name)
        return float(names.index(value))
    return float(value)


@functools.cache
def _of_names(names: tuple[str, ...]) -> np.dtype[Any]:
    """One type object for one set of names: compiled code knows it again at once."""
    return np.dtype([(name, "f8") for name in names])


def layout(family: Mapping[str, type[Parameters]], prefix: str = "") -> np.dtype[Any]:
    """Type of the family's records: `union_fields` and then what any member derives, each name behind the prefix."""
    derived = dict.fromkeys(name for member in family.values() for name in getattr(member, "derived", ()))
    return _of_names(tuple(prefix + name for name in (*union_fields(family), *derived)))


def records(
    family: Mapping[str, type[Parameters]],
    member: Parameters,
    prefix: str = "",
    derived: Mapping[str, float] = MappingProxyType({}),
) -> np.ndarray[Any, Any]:
    """The member as an array of one record: a record by itself costs compiled code that is called from Python 30 µs."""
    made = np.zeros(1, layout(family, prefix))
    for name in union_fields(family):
        made[prefix + name] = field_value(member, name)
    for name, value in derived.items():
        made[prefix + name] = value
    return made


def fields_layout(cls: type[Parameters]) -> np.dtype[Any]:
    """Type of a record with the fields of one dataclass."""
    return _of_names(tuple(field.name for field in dataclasses.fields(cls)))


def numbers(member: Parameters) -> np.ndarray[Any, Any]:
    """The numbers of a dataclass that is in no family, as an array of one record."""
    kind = fields_layout(type(member))
    return np.array([tuple(getattr(member, name) for name in kind.names or ())], dtype=kind)


def record(prefix: str, family: Mapping[str, type[Parameters]], member: Parameters) -> Any:
    """The member alone as a record with fields prefix_name, as the kernels of its family take it."""
    return records(family, member, f"{prefix}_").view(np.recarray)[0]


def kernel_of(member: type[Any], name: str) -> Any:
    """The kernel of that name in the member's file, or in that of a class it derives from; None without one."""
    return next((k for c in member.__mro__ if (k := getattr(sys.modules[c.__module__], name, None)) is not None), None)


def written(module: str, source: str, functions: Mapping[str, Any]) -> Any:
    """The function that a source defines, compiled as one of a module's own."""
    file = str(sys.modules[module].__file__)
    names: dict[str, Any] = {"__name__": module, **functions}
    exec(compile(source, file, "exec"), names)
    return njit(names[source[4 : source.index("(")]])


def dispatch(
    module: str, family: Mapping[str, type[Any]], kernel: str, kind: str, otherwise: str = "", name: str = ""
) -> Any:
    """The kernel of the member that a number asks for.

    Parameters
    ----------
    module : `__name__` of the caller, whose file imports the family.
    family : its table; asked for in its order.
    kernel : name of the members' function; all take the same arguments.
    kind : expression of those arguments that gives the number, `p.kind` say.
    otherwise : what a member without this kernel gives; where all have one, the last needs no question.
    name : of the function; that of the kernel where not given.
    """
    found = {f"of_{key}": (member.code, kernel_of(member, kernel)) for key, member in family.items()}
    own = {key: (code, function) for key, (code, function) in found.items() if function is not None}
    arguments = ", ".join(inspect.signature(next(iter(own.values()))[1]).parameters)
    lines = [f"    if {kind} == {code}:\n        return {key}({arguments})" for key, (code, _) in own.items()]
    if not otherwise:
        lines[-1] = f"    return {list(own)[-1]}({arguments})"
    else:
        lines.append(f"    return {otherwise}")
    source = f"def {name or kernel}({arguments}):\n" + "\n".join(lines)
    return written(module, source, {key: function for key, (_, function) in own.items()})


def having(module: str, family: Mapping[str, type[Any]], attribute: str, kind: str) -> Any:
    """Whether the member of a record `p` has a class constant that is true, as a compiled function of its name."""
    codes = ", ".join(str(member.code) for member in family.values() if getattr(member, attribute))
    return written(module, f"def {attribute}(p):\n    return {kind} in ({codes},)", {})
