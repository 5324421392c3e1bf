"""ROS parameters from `Parameters` dataclasses: one schema for YAML, nodes and reports; no node declares by hand.

Each field becomes a parameter with its type, "meaning [unit]", its range, and read-only unless it is live. A nested
set adds its field's name and a dot. A live change builds a new frozen object, which is checked as the first one was;
it is refused with the reason, or waits until the node takes it at its next sample.

`LiveLaw` is a law that a node runs by name, with its parameters beside it: both may change between two samples.

`read_parameter_files` reads them as rcl does: which nodes their sections address.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.quantities import Parameters, ShakeError, unknown_name
from shake_ros.settings import load_variant, read_yaml

P = TypeVar("P", bound="Parameters | TableParameters")

# What rclpy itself declares or reads from the overrides of every node.
OWN_OVERRIDES = ("use_sim_time", "start_type_description_service", "qos_overrides.")
LARGEST_INTEGER = 2**63 - 1


def _range(value: Any, metadata: Any) -> dict[str, Any]:
    """The range fields of a descriptor; one-sided bounds take the largest number as the other side."""
    low, high = metadata.get("low", -math.inf), metadata.get("high", math.inf)
    if isinstance(value, bool | str) or (math.isinf(low) and math.isinf(high)):
        return {}
    if isinstance(value, int):
        bounds = IntegerRange(
            from_value=int(max(low, -LARGEST_INTEGER)), to_value=int(min(high, LARGEST_INTEGER)), step=0
        )
        return {"integer_range": [bounds]}
    largest = sys.float_info.max
    bounds = FloatingPointRange(from_value=max(low, -largest), to_value=min(high, largest), step=0.0)
    return {"floating_point_range": [bounds]}


def descriptor(name: str, value: Any, metadata: Any, live: bool = False) -> ParameterDescriptor:
    """Descriptor of one field: "meaning [unit]", range, read-only unless `live` or marked so."""
    unit = metadata.get("unit", "")
    meaning = metadata.get("meaning", "")
    names = metadata.get("names", ())
    return ParameterDescriptor(
        name=name,
        type=Parameter.Type.from_parameter_value(value).value,
        description=f"{meaning} [{unit}]" if unit else meaning,
        additional_constraints=f"one of {', '.join(names)}" if names else "",
        read_only=not (live or metadata.get("live", False)),
        **_range(value, metadata),
    )


def _belongs(table: TableParameters, name: str) -> bool:
    """Whether a dotted name is an effect's or a field of the law that this table has in its section."""
    section, _, rest = name.partition(".")
    return section == "effects" or hasattr(getattr(table, section), rest)


def flatten(value: Parameters | TableParameters, prefix: str = "") -> dict[str, tuple[Any, Any]]:
    """Parameter name → (value, metadata) of every field, nested sets with their field's name and a dot."""
    if isinstance(value, TableParameters):
        return {
            prefix + name: (int(value.value(name)) if field.type == "int" else value.value(name), field.metadata)
            for name, field in FIELDS.items()
            if _belongs(value, name)
        }
    found: dict[str, tuple[Any, Any]] = {}
    for field in dataclasses.fields(value):
        content = getattr(value, field.name)
        name = prefix + field.name
        if isinstance(content, Parameters):
            found |= flatten(content, f"{name}.")
        elif isinstance(content, bool | int | float | str):
            found[name] = (content, field.metadata)
    return found


def replaced(value: P, changes: dict[str, Any]) -> P:
    """A copy of `value` with dotted names changed, checked again; raises ShakeError with the reason."""
    if isinstance(value, TableParameters):
        return cast(P, value.with_values(changes))
    direct: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for name, content in changes.items():
        head, _, rest = name.partition(".")
        if rest:
            nested.setdefault(head, {})[rest] = content
        else:
            direct[head] = content
    for head, inner in nested.items():
        direct[head] = replaced(getattr(value, head), inner)
    return value.replace(**direct)


def as_double(parameter: Parameter[Any]) -> Parameter[Any]:
    """An integer, or a text that is a number, as the double that is meant.

    `ros2 param set` reads `1.8e7` by the rules of YAML 1.1, as a text.

    >>> as_double(Parameter("pressure", value="1.8e7")).value, as_double(Parameter("pressure", value="high")).value
    (18000000.0, 'high')
    """
    if parameter.type_ not in (Parameter.Type.INTEGER, Parameter.Type.STRING):
        return parameter
    try:
        return Parameter(parameter.name, Parameter.Type.DOUBLE, float(parameter.value))
    except ValueError:
        return parameter


def _given(override: Parameter[Any] | None, configured: Any) -> str:
    return repr(configured if override is None else override.value)


class LiveSet(Generic[P]):
    """One parameter set of a node: the object in use, and the newest accepted one.

    Parameters
    ----------
    value : the set as read from the configuration.
    prefix : of the ROS parameter names, with its dot.
    accept : raises ShakeError where the node cannot use a set that is within its bounds.
    """

    def __init__(self, value: P, prefix: str = "", accept: Callable[[P], object] = lambda _: None) -> None:
        self.value = value
        self.prefix = prefix
        self.accept = accept
        self.changed = False
        self.committed: Callable[[], None] = lambda: None  # called once a change that was accepted is in `value`
        self.owner = ""  # the parameter whose change exchanges this set for another; the two are not changed together

    def take(self) -> P:
        """The newest accepted set; call it between two samples."""
        self.changed = False
        return self.value


class NodeParameters:
    """Every parameter set of one node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._sets: list[LiveSet[Any]] = []
        self._owner: dict[str, LiveSet[Any]] = {}
        node.add_on_set_parameters_callback(self._on_set)
        if hasattr(node, "add_pre_set_parameters_callback"):  # not yet in Humble
            node.add_pre_set_parameters_callback(self._doubles)

    def declare(
        self, value: P, prefix: str = "", accept: Callable[[P], object] = lambda _: None, *, live: bool = False
    ) -> LiveSet[P]:
        """Declare the fields of `value`; overrides given at the start replace the configured values.

        With `live` every one of them may change while the node runs. Raises ShakeError where an override has a wrong
        type or is out of range.
        """
        entries = flatten(value, prefix)
        overrides = self._node._parameter_overrides  # rclpy offers no public look at them
        changes: dict[str, Any] = {}
        for name, (content, metadata) in entries.items():
            override = overrides.get(name)
            if isinstance(content, float) and override is not None:
                overrides[name] = as_double(override)
            try:
                given = self._node.declare_parameter(name, content, descriptor(name, content, metadata, live)).value
            except InvalidParameterTypeException:
                kind = type(content).__name__
                raise ShakeError(f"parameter {name} = {_given(override, content)} is not of type {kind}") from None
            except InvalidParameterValueException:
                bounds = f"{metadata.get('low', -math.inf):g} … {metadata.get('high', math.inf):g}"
                text = f"parameter {name} = {_given(override, content)} is outside {bounds} {metadata.get('unit', '')}"
                raise ShakeError(text.rstrip(" -")) from None
            if given != content:
                changes[name[len(prefix) :]] = given
        try:
            declared = LiveSet(replaced(value, changes), prefix, accept)
            accept(declared.value)
        except ShakeError as error:
            raise type(error)(f"parameter {error}") from None
        self._sets.append(declared)
        self._owner |= dict.fromkeys(entries, declared)
        return declared

    def exchange(self, present: LiveSet[P], value: P, *, live: bool = False) -> None:
        """Put `value`, which may be of another class, in the place of a set: its parameters come, the others go."""
        for name in [name for name, owner in self._owner.items() if owner is present]:
            # rclpy undeclares nothing that is read-only
            del self._node._parameters[name], self._node._descriptors[name], self._owner[name]
        present.value, present.changed = value, True
        for name, (content, metadata) in flatten(value, present.prefix).items():
            made = descriptor(name, content, metadata, live)
            self._node.declare_parameter(name, content, made, ignore_override=True)
            self._owner[name] = present

    def check_overrides(self, shared: Collection[str] = ()) -> None:
        """Raise UnknownName where the command line or a parameter file names a parameter that this node has not.

        Those `shared`, which a file gives to several nodes at once, are left alone with a warning.
        """
        for name in self._node._parameter_overrides:
            if name in self._owner or name.startswith(OWN_OVERRIDES):
                continue
            if name not in shared:
                raise unknown_name("parameter", name, self._owner)
            self._node.get_logger().warning(f"the shared parameter '{name}' is not a parameter of this node")

    def _doubles(self, parameters: list[Parameter[Any]]) -> list[Parameter[Any]]:
        """What is set, with doubles where doubles are meant."""
        declared = self._node._parameters
        doubles = {one.name for one in declared.values() if one.type_ == Parameter.Type.DOUBLE}
        return [as_double(one) if one.name in doubles else one for one in parameters]

    def _on_set(self, parameters: list[Parameter[Any]]) -> SetParametersResult:
        """Accept all of the changes or none: build every new set first, swap afterwards."""
        changes: dict[int, dict[str, Any]] = {}
        for parameter in parameters:
            live = self._owner.get(parameter.name)
            if live is not None:
                changes.setdefault(id(live), {})[parameter.name[len(live.prefix) :]] = parameter.value
        accepted = []
        for live in self._sets:
            if id(live) not in changes:
                continue
            if any(parameter.name == live.owner for parameter in parameters):
                reason = f"set {live.owner} first: it exchanges these parameters"
                return SetParametersResult(successful=False, reason=reason)
            try:
                new = replaced(live.value, changes[id(live)])
                live.accept(new)
            except ShakeError as error:
                return SetParametersResult(successful=False, reason=str(error))
            accepted.append((live, new))
        for live, new in accepted:
            live.value, live.changed = new, True
            live.committed()
        return SetParametersResult(successful=True)


OPTION = "--params-file"
PARAMETERS = "ros__parameters"


def _leaves(content: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of all values."""
    for name, value in content.items() if isinstance(content, Mapping) else ():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def sections(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Node name, as a file writes it, and its parameters.

    >>> list(sections({"lab": {"plant": {"ros__parameters": {"seed": 2}}}, "/**": {"ros__parameters": {"seed": 3}}}))
    [('lab/plant', {'seed': 2}), ('/**', {'seed': 3})]
    """
    for name, inner in content.items() if isinstance(content, Mapping) else ():
        if name == PARAMETERS:
            yield path, inner
        else:
            yield from sections(inner, f"{path}/{name}" if path else str(name))


def read_parameter_files(node: str, arguments: Sequence[str]) -> tuple[set[str], list[str]]:
    """Of the files that the node of this full name is started with: what they give to several nodes, and warnings.

    A warning is for a section that names this node without its namespace, and so another node.
    """
    shared: set[str] = set()
    warnings = []
    for option, file in zip(arguments, arguments[1:], strict=False):
        for name, parameters in sections(read_yaml(Path(file))) if option == OPTION else ():
            full = f"/{name.lstrip('/')}"
            if "*" in name:
                shared.update(_leaves(parameters))
            elif full != node and full.rsplit("/", 1)[-1] == node.rsplit("/", 1)[-1]:
                warnings.append(f"{file}: '{name}:' is {full}; for this node write '{node}:'")
    return shared, warnings


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
    parameters : of the node.
    parameter : the one that names the configuration.
    own : the node's set that holds it.
    load : name → kind and parameter sets.
    make : kind and sets → the law, compiled.
    live : whether all parameters may change, or those alone that are marked so.
    """

    def __init__(
        self,
        parameters: NodeParameters,
        parameter: str,
        own: LiveSet[Any],
        load: Callable[[str], tuple[str, Sets]],
        make: Callable[[str, Sets], T],
        *,
        live: bool,
    ) -> None:
        self._parameters = parameters
        self._parameter, self._own, self._load, self._make, self._live = parameter, own, load, make, live
        self._name = getattr(own.value, parameter)
        self._kind, sets = load(self._name)
        self._sets: dict[str, LiveSet[Parameters]] = {}
        for prefix, value in sets.items():
            self._sets[prefix] = parameters.declare(value, prefix, live=live)
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
