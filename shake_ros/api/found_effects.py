"""Effects that a declared model was missing, as a result of `close_loop` lists them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from shake_ros.core.identification.uncertainty import Estimate
from shake_ros.report.result_table import ResultTable


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the declared model was missing.

    Attributes
    ----------
    name, place : of the effect.
    parameters : its own, with standard errors.
    evidence : why this one.
    alternatives : effects that these recordings cannot distinguish from it.
    state : its verdict.
    worth : error of the final model without it, over that with it [-].
    """

    name: str
    place: str
    parameters: tuple[Estimate, ...]
    evidence: str
    alternatives: tuple[str, ...]
    state: str = ""
    worth: float = math.nan


class Effects(Sequence[FoundEffect]):
    """Effects in the order in which they were added.

    none : what is printed where there are none.
    """

    def __init__(self, effects: Sequence[FoundEffect], none: str = "nothing is missing") -> None:
        self._effects, self._none = tuple(effects), none

    def __len__(self) -> int:
        return len(self._effects)

    def __getitem__(self, key: Any) -> Any:
        return self._effects[key]

    def __iter__(self) -> Iterator[FoundEffect]:
        return iter(self._effects)

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names."""
        return tuple(effect.name for effect in self)

    @property
    def frame(self) -> ResultTable:
        """A row for each parameter."""
        rows = [
            (
                e.name,
                e.place,
                p.name.rpartition(".")[2],
                p.value,
                p.std_error,
                p.unit,
                e.state,
                e.worth,
                ", ".join(e.alternatives) or None,
            )
            for e in self
            for p in e.parameters
        ]
        heads = (
            "effect",
            "place",
            "parameter",
            "value",
            "std. error",
            "unit",
            "state",
            "worth",
            "not distinguished from",
        )
        return ResultTable(heads, rows)

    def __repr__(self) -> str:
        return repr(self.frame) if self else self._none

    def _repr_html_(self) -> str:
        return self.frame._repr_html_() if self else self._none
