"""config/*.yaml → dataclasses, strict: unknown, missing and doubled keys are errors that name the file."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import yaml

from shake_ros.physics.fluid import Oil
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableLayout, TableParameters
from shake_ros.physics.plant.temperature import OilState, at_temperature
from shake_ros.quantities import Parameters, ShakeError, member_from, strict_keys, unknown_name
from shake_ros.safety.causes import InterlockParameters
from shake_ros.search.search_settings import SearchSettings

try:  # libyaml's, which takes a fifth of the time
    from yaml import CSafeLoader as SafeLoader
except ImportError:
    from yaml import SafeLoader  # type: ignore[assignment]

P = TypeVar("P", bound=Parameters)
OIL_KEYS = ("oil", *(field.name for field in fields(OilState)))  # of the section `fluid`
LARGEST_DOCUMENT = 1_000_000  # nodes


class _StrictLoader(SafeLoader):
    """A YAML loader that refuses a key given twice, and what its aliases blow up; reads 1e5 as a number."""

    def get_single_node(self) -> yaml.Node | None:
        """The document, unless it is larger than LARGEST_DOCUMENT with every alias written out."""
        node: yaml.Node | None = super().get_single_node()
        if node is not None and _written_out(node, {}) > LARGEST_DOCUMENT:
            raise yaml.composer.ComposerError(None, None, "aliases blow it up", node.start_mark)
        return node


def _written_out(node: yaml.Node, known: dict[int, int]) -> int:
    """How many nodes there are below one, each alias counted as its target; too many where it contains itself."""
    if id(node) not in known:
        known[id(node)] = sys.maxsize
        parts = [] if isinstance(node, yaml.ScalarNode) else node.value
        inner = [one for part in parts for one in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1 + sum(_written_out(one, known) for one in inner)
    return known[id(node)]


def _strict_mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)  # type: ignore[no-untyped-call]
        if isinstance(key, list | dict):
            raise yaml.constructor.ConstructorError(None, None, "a key is not a plain name", key_node.start_mark)
        if key in seen:
            raise yaml.constructor.ConstructorError(None, None, f"key '{key}' twice", key_node.start_mark)
        seen[key] = loader.construct_object(value_node, deep=True)  # type: ignore[no-untyped-call]
    return seen


def _number(loader: _StrictLoader, node: yaml.ScalarNode) -> float:
    return float(loader.construct_scalar(node).replace("_", ""))


# what PyYAML's own constructors let through, say of `!!int ''` or `!!timestamp x`
_CARELESS = (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)

_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _strict_mapping)
_StrictLoader.add_constructor("!float", _number)
_StrictLoader.add_implicit_resolver(  # YAML 1.1 takes 1e5 and 1.0e5 for text
    "!float", re.compile(r"^[-+]?(?:\d[\d_]*\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+0123456789.")
)


def config_folder() -> Path:
    """The folder config/: beside the package in a source tree, else share/shake_ros/config where it was installed."""
    package = Path(__file__).resolve().parent
    beside = package.parent / "config"
    if beside.is_dir():
        return beside
    for root in (Path(sys.prefix), *package.parents):
        installed = root / "share" / "shake_ros" / "config"
        if installed.is_dir():
            return installed
    raise ShakeError(f"config folder not found: neither {beside} nor share/shake_ros/config under {sys.prefix}")


def read_yaml(path: Path) -> Any:
    """The content of a YAML file; one clear line where it is absent, unreadable or malformed."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ShakeError(f"{path}: is not UTF-8 text") from None
    return value_of(text, str(path))


def value_of(text: str, where: str) -> Any:
    """What a text in YAML says; one clear line where it is malformed."""
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, *_CARELESS) as error:
        line = " ".join(str(error).split())
        raise ShakeError(f"{where}: not valid YAML: {line[:300]}") from None


def find(kind: str, name: str) -> Path:
    """Path of configuration `name` of a kind (table, controller, observer, reference): a known name or a file.

    config/<kind>/<name>.yaml; the `default` of a kind that has a single one is config/<kind>.yaml. Raises UnknownName,
    listing the known names, where it is neither.
    """
    if name.endswith((".yaml", ".yml")) or "/" in name:
        return Path(name).expanduser()
    folder = config_folder()
    known = {path.stem: path for path in (folder / kind).glob("*.yaml")}
    if (single := folder / f"{kind}.yaml").is_file():
        known["default"] = single
    if name not in known:
        raise unknown_name(kind, name, known)
    return known[name]


def load_parameters(kind: str, name: str, cls: type[P]) -> P:
    """The parameters of config/<kind>/<name>.yaml, or of a YAML file given by path."""
    path = find(kind, name)
    return cls.from_mapping(read_yaml(path), str(path))


def load_content(
    kind: str, name: str, known: Sequence[str], required: Sequence[str] | None = None
) -> tuple[dict[str, Any], str]:
    """The content of such a file with the required keys (all known ones) and no other, and its path for errors."""
    path = find(kind, name)
    needed = known if required is None else required
    return dict(strict_keys(read_yaml(path), known, str(path), needed, kind="key")), str(path)


def load_variant(kind: str, name: str, family: Mapping[str, type[P]]) -> tuple[str, P]:
    """Read config/<kind>/<name>.yaml, whose key `kind` picks the class in a family's table.

    A `model` that is a relative path to a file lies beside the configuration.

    Returns
    -------
    (family name, parameters)
    """
    path = find(kind, name)
    member, parameters = member_from(read_yaml(path), family, str(path), kind=kind)
    model = Path(getattr(parameters, "model", ""))
    if model.suffix in (".yaml", ".yml") and not model.is_absolute():
        parameters = parameters.replace(model=str(path.absolute().parent / model))
    return member, parameters


def load_table(given: str | Path | TableParameters) -> TableParameters:
    """The table of config/table/<name>.yaml, or of a YAML file given by path; a table as it is."""
    if isinstance(given, TableParameters):
        return given
    if not isinstance(given, str | Path):
        raise ShakeError(f"table: expected a name, a file or a table, not a {type(given).__name__}")
    path = find("table", str(given))
    return table_of(read_yaml(path), str(path))


def table_of(content: Any, where: str, layout: TableLayout = FULL_LAYOUT) -> TableParameters:
    """The table of a file's content, at the temperature that its section `fluid` names.

    The section names an oil of config/fluid, or a file of one, and how warm it is (`OilState`).

    Raises
    ------
    ShakeError : of the layout; an unknown oil, or a section `fluid` of a table without hydraulics.
    """
    if layout is not FULL_LAYOUT or not isinstance(content, Mapping) or "fluid" not in content:
        return layout.table(content, where)
    table = layout.table({key: value for key, value in content.items() if key != "fluid"}, where)
    fluid = strict_keys(content["fluid"], OIL_KEYS, f"{where}: fluid", OIL_KEYS, kind="key")
    path = find("fluid", str(fluid["oil"]))
    oil = Oil.from_mapping(read_yaml(path), str(path)).parameters
    state = OilState.from_mapping({key: fluid[key] for key in OIL_KEYS[1:]}, f"{where}: fluid")
    return at_temperature(table, oil, state)


def load_interlock(name: str) -> InterlockParameters:
    """The interlock of config/interlock/<name>.yaml, or of a YAML file given by path."""
    return load_parameters("interlock", name, InterlockParameters)


def load_search(changes: str | None = None) -> SearchSettings:
    """The thresholds of config/discovery/search.yaml, and those that differ in config/discovery/<changes>.yaml."""
    path = find("discovery", "search")
    content = read_yaml(path)
    if changes is not None:
        path = find("discovery", changes)
        content = {**content, **read_yaml(path)}
    return SearchSettings.from_mapping(content, str(path))


def save_table(path: Path, table: TableParameters, comment: str) -> None:
    """Write a table as YAML with a comment on top; an existing file is an error."""
    if path.exists():
        raise ShakeError(f"{path}: exists already")
    lines = "".join(f"# {line}\n" for line in comment.splitlines())
    path.write_text(lines + yaml.safe_dump(table.to_mapping(), sort_keys=False), encoding="utf-8")
