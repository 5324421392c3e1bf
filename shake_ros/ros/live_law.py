"""A law that a node runs by name, with its parameters beside it: both may change between two samples."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from shake_ros.core.quantities import Parameters
from shake_ros.ros.frame import Frame
from shake_ros.ros.parameters import LiveSet
from shake_ros.settings import load_variant

T = TypeVar("T")
Sets = Mapping[str, Any]  # prefix of the ROS parameters → parameter set


def variants(kind: str, family: Mapping[str, type[Parameters]]) -> Callable[[str], tuple[str, Sets]]:
    """What loads the configurations of a family in config/<kind>: kind and parameters, the latter without a prefix."""

    def load(name: str) -> tuple[str, Sets]:
        chosen, parameters = load_variant(kind, name, family)
        return chosen, {"": parameters}

    return load


class LiveLaw(Generic[T]):
    """One law of a family, ready to run.

    A change builds the new law while the present one still runs, and is refused where that fails. After a change of
    name the parameters of the new law stand in the place of the old one's.

    Parameters
    ----------
    parameter : the node's parameter that names the configuration.
    own : the node's set that holds it.
    load : name → kind and parameter sets.
    make : kind and sets → the law, compiled.
    live : whether all parameters may change, or those alone that are marked so.
    """

    def __init__(
        self,
        frame: Frame,
        parameter: str,
        own: LiveSet[Any],
        load: Callable[[str], tuple[str, Sets]],
        make: Callable[[str, Sets], T],
        *,
        live: bool,
    ) -> None:
        self._parameters = frame.parameters
        self._parameter, self._own, self._load, self._make, self._live = parameter, own, load, make, live
        self._name = getattr(own.value, parameter)
        self._kind, sets = load(self._name)
        self._sets: dict[str, LiveSet[Parameters]] = {}
        for prefix, value in sets.items():
            self._sets[prefix] = frame.parameters.declare(value, prefix, live=live)
            self._sets[prefix].owner = parameter
        self._made: tuple[tuple[str, Sets], T] | None = None
        self._chosen: tuple[str, str, Sets] | None = None
        self._renamed = True
        for prefix, one in self._sets.items():
            one.accept = functools.partial(self._accept_values, prefix)
        own.accept, own.committed = self._accept_name, self._exchange

    @property
    def changed(self) -> bool:
        """Whether `take` has something new."""
        return self._renamed or any(one.changed for one in self._sets.values())

    def take(self) -> tuple[T, bool]:
        """The newest law, and whether it is another by name; call it between two samples."""
        renamed, self._renamed = self._renamed, False
        return self._ready(self._kind, {prefix: one.take() for prefix, one in self._sets.items()}), renamed

    def _ready(self, kind: str, sets: Sets) -> T:
        """The law of these sets; remembered, since it is asked for once to check and once to use."""
        if self._made is None or self._made[0] != (kind, sets):
            self._made = (kind, sets), self._make(kind, sets)
        return self._made[1]

    def _accept_values(self, prefix: str, value: Parameters) -> None:
        self._ready(self._kind, {**{name: one.value for name, one in self._sets.items()}, prefix: value})

    def _accept_name(self, own: Any) -> None:
        name = getattr(own, self._parameter)
        self._chosen = None
        if name != self._name:
            self._chosen = name, *self._load(name)
            self._ready(*self._chosen[1:])

    def _exchange(self) -> None:
        """The named law's parameters come in the place of the present one's."""
        if self._chosen is None:
            return
        (self._name, self._kind, sets), self._chosen, self._renamed = self._chosen, None, True
        for prefix, one in self._sets.items():
            self._parameters.exchange(one, sets[prefix], live=self._live)
