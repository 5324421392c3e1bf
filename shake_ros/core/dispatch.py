"""One compiled function for a whole family, written from the family's table.

Each member of a family has its kernels in its own file, under the names that the family agrees on. `dispatch` writes
what one would write by hand, a function that asks the record for its number and calls that member's kernel,

    def level(p, velocity):
        if p.friction_kind == 0:
            return of_tustin(p, velocity)
        ...

so that a new member is one file and one row of the table, nothing is looked up by name within a step, and one
compilation serves all members. numba caches such a function like any other, as one of the file of `module`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Mapping
from typing import Any

from shake_ros.core.compiled import njit


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
