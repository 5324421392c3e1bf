"""Physical quantities as dataclass fields: name, unit, meaning, bounds; and the error types of the package.

Every parameter of every law, effect, controller, observer, reference and node is a field made by `quantity`
(a number) or `choice` (a name) in a frozen dataclass derived from `Parameters`. The same field gives the
check of a YAML file, the ROS parameter with its range and description, and the column of a report.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import reprlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass
from typing import Any, TypeVar

P = TypeVar("P", bound="Parameters")
LONGEST_LINE = 1500  # characters of an error


class ShakeError(ValueError):
    """Wrong input from outside: one line that names what and where. A command that meets it exits with 2.

    Line ends and what else cannot be printed become blanks, whatever a file has brought into the text.
    """

    def __init__(self, text: object = "") -> None:
        line = "".join(c if c.isprintable() else " " for c in str(text))
        super().__init__(line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 4]} ...")


class OutOfBounds(ShakeError):
    """A quantity outside its bounds, or not a finite number."""


class UnknownName(ShakeError):
    """A name that is not known; the message lists the known ones and the nearest."""


MOST_NAMED = 30  # names that an error lists
LONGEST_SHOWN = 80  # characters of a foreign value in an error
LARGEST = sys.float_info.max
_BRIEF = reprlib.Repr()
_BRIEF.maxstring = _BRIEF.maxother = _BRIEF.maxlong = LONGEST_SHOWN


def shown(value: object) -> str:
    """A foreign value on one line of an error: short, whatever it is.

    >>> shown("a" * 200)[:5], len(shown("a" * 200)), shown([[[["deep"]]]])
    ("'aaaa", 80, "[[[['deep']]]]")
    """
    try:
        return _BRIEF.repr(value)
    except ValueError:  # an integer of more digits than Python prints
        return f"a {type(value).__name__} too large to print"


def _brief(name: object) -> str:
    """A name as it stands where it is short and printable, else cut."""
    text = str(name) if isinstance(name, str | float) or name is None else shown(name).strip("'")
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def unknown_name(kind: str, name: object, known: Iterable[str], where: str = "") -> UnknownName:
    """The error for `name`, which is not among `known`; of very many known names the nearest are listed.

    >>> print(unknown_name("effect", "soft_zon", ["soft_zone", "dead_volume"]))
    unknown effect 'soft_zon' (did you mean 'soft_zone'?); known: dead_volume, soft_zone
    """
    names = sorted(known)
    brief = _brief(name)
    wanted = brief.rpartition(".")[2]
    near = sorted(names, key=lambda n: -difflib.SequenceMatcher(None, wanted, n.rpartition(".")[2]).ratio())[
        :MOST_NAMED
    ]
    close = difflib.get_close_matches(wanted, [n.rpartition(".")[2] for n in near], n=1)
    hint = next((f" (did you mean '{n}'?)" for n in near if close and n.rpartition(".")[2] == close[0]), "")
    place = f"{where}: " if where else ""
    listed = ", ".join(names) if len(names) <= MOST_NAMED else f"{', '.join(near)} and {len(names) - MOST_NAMED} more"
    return UnknownName(f"{place}unknown {kind} '{brief}'{hint}; known: {listed}")


def quantity(
    unit: str,
    meaning: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    live: bool = False,
    default: Any = MISSING,
) -> Any:
    """A number in a `Parameters` dataclass.

    Parameters
    ----------
    unit : SI unit, "-" for a pure number.
    meaning : what it is, in a few words.
    low, high : inclusive bounds.
    live : whether a node lets it be changed while running.
    default : only for what is neutral (an effect's absence, a switch); physical numbers live in config/.
    """
    return dataclasses.field(
        default=default, metadata={"unit": unit, "meaning": meaning, "low": low, "high": high, "live": live}
    )


def choice(meaning: str, names: Iterable[str] = (), *, live: bool = False, default: Any = MISSING) -> Any:
    """A name in a `Parameters` dataclass; `names` lists what is allowed, empty for any text."""
    return dataclasses.field(
        default=default, metadata={"unit": "", "meaning": meaning, "names": tuple(names), "live": live}
    )


def check(name: str, value: Any, metadata: Mapping[str, Any], kind: type) -> Any:
    """`value` converted to `kind` after its bounds are checked; raises OutOfBounds or UnknownName.

    >>> check("damping", 0.7, {"low": 0.0, "high": 2.0, "unit": "-"}, float)
    0.7
    """
    if kind is str:
        names = metadata.get("names", ())
        if not isinstance(value, str):
            raise OutOfBounds(f"{name} = {shown(value)} is not a text")
        if names and value not in names:
            raise unknown_name(name, value, names)
        return value
    if kind is bool:
        if not isinstance(value, bool):
            raise OutOfBounds(f"{name} = {shown(value)} is not true or false")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not -LARGEST <= value <= LARGEST:
        raise OutOfBounds(f"{name} = {shown(value)} is not a finite number")
    low, high = metadata.get("low", -math.inf), metadata.get("high", math.inf)
    if not low <= value <= high:
        unit = metadata.get("unit", "-")
        suffix = "" if unit in ("", "-") else f" {unit}"
        raise OutOfBounds(f"{name} = {value:g} is outside {low:g} … {high:g}{suffix}")
    if kind is int and float(value) != int(value):
        raise OutOfBounds(f"{name} = {shown(value)} is not a whole number")
    return kind(value)


def strict_keys(
    content: Any, known: Iterable[str], where: str, required: Iterable[str] = (), *, kind: str = "parameter"
) -> Mapping[str, Any]:
    """`content` as a mapping that has every required key and none but known ones; errors list what is known.

    >>> strict_keys({"mass": 2.0}, ["mass", "length"], "beam.yaml", ["mass"])
    {'mass': 2.0}
    """
    needed = list(required)
    if not isinstance(content, Mapping):
        expected = ", ".join(needed) or "a mapping of names to values"
        raise ShakeError(f"{where}: expected {expected}, got {type(content).__name__}")
    names = list(known)
    for key in content:
        if key not in names:
            raise unknown_name(kind, key, names, where)
    missing = [name for name in needed if name not in content]
    if missing:
        raise ShakeError(f"{where}: missing {'' if kind in ('parameter', 'key') else f'{kind} '}{', '.join(missing)}")
    return content


def member_from(
    content: Any, family: Mapping[str, type[P]], where: str, *, kind: str, declared: str | None = None
) -> tuple[str, P]:
    """Name and parameters of the member of a family that the key `kind` of a YAML mapping picks.

    Parameters
    ----------
    kind : what the family is of, for errors.
    declared : the member where there is no key `kind`.
    """
    rest = dict(content) if isinstance(content, Mapping) else content
    chosen = rest.pop("kind", declared) if isinstance(rest, dict) else declared
    if chosen is None:
        raise ShakeError(f"{where}: missing key 'kind' (one of {', '.join(sorted(family))})")
    if not isinstance(chosen, str) or chosen not in family:
        raise unknown_name(kind, chosen, family, where)
    return chosen, family[chosen].from_mapping(rest, where)


KINDS: dict[str, type] = {"float": float, "int": int, "bool": bool, "str": str}


@dataclass(frozen=True)
class Parameters:
    """Base of every parameter set: checks each field against its bounds when built."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            kind = KINDS.get(str(field.type))
            if kind is not None:
                value = check(field.name, getattr(self, field.name), field.metadata, kind)
                object.__setattr__(self, field.name, value)

    @classmethod
    def from_mapping(cls: type[P], mapping: Mapping[str, Any], where: str) -> P:
        """Build from a YAML mapping; unknown and missing keys are errors that list what is known."""
        fields = dataclasses.fields(cls)
        required = [f.name for f in fields if f.default is MISSING]
        strict_keys(mapping, [f.name for f in fields], where, required)
        try:
            return cls(**mapping)
        except ShakeError as error:
            raise type(error)(f"{where}: {error}") from None

    def replace(self: P, **changes: Any) -> P:
        """A copy with some fields changed, checked again; an unknown name is an error."""
        names = [f.name for f in dataclasses.fields(self)]
        for key in changes:
            if key not in names:
                raise unknown_name("parameter", key, names)
        return dataclasses.replace(self, **changes)


def describe(cls: type[Parameters]) -> dict[str, Mapping[str, Any]]:
    """Metadata (unit, meaning, low, high, live) of each field by name."""
    return {f.name: f.metadata for f in dataclasses.fields(cls)}
