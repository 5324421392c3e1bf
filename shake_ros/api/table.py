"""`table`: a configuration of a table from nameplates, with its assumptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from shake_ros.quantities import ShakeError
from shake_ros.result_folder import refuse_existing, writing
from shake_ros.settings import find, read_yaml

SHARE = {  # standard deviation of a number from a nameplate, in parts of it
    "body.cylinder_volume": 0.1,  # lines and dead volumes are rarely drawn
    "body.table_mass": 0.05,  # rod, piston and moving oil
    "valve.flow_coefficient": 0.1,  # the usual tolerance of a rated flow
    "valve.natural_frequency": 0.2,  # depends on amplitude and pressure
    "valve.damping": 0.2,
}


@dataclass(frozen=True)
class TableFile:
    """A configuration. content : of the YAML file. assumed : what was taken without being given, a line each."""

    content: dict[str, Any]
    assumed: tuple[str, ...]

    def save(self, path: str | Path, force: bool = False) -> Path:
        """Write the file with its assumptions on top; `force` replaces an existing one."""
        path = Path(path)
        refuse_existing(path, force=force)
        top = ["From nameplates. `unknown` starts from the recordings, `{value, sd}` is a prior, a number is exact."]
        text = "".join(f"# {line}\n" for line in [*top, *(f"Assumed: {a}" for a in self.assumed)])
        with writing():
            path.write_text(text + yaml.safe_dump(self.content, sort_keys=False), encoding="utf-8")
        return path

    def __repr__(self) -> str:
        return "\n".join([yaml.safe_dump(self.content, sort_keys=False), *(f"assumed: {a}" for a in self.assumed)])


def table(
    *,
    bore: float | None = None,
    rod: float | None = None,
    single_rod: bool = False,
    stroke: float | None = None,
    rated_flow: float | None = None,
    rated_drop: float = 70e5,
    supply: float | None = None,
    table_mass: float | None = None,
    specimen_mass: float = 0.0,
    hose_volume: float = 0.0,
    valve_frequency: float | None = None,
    valve_damping: float | None = None,
) -> TableFile:
    """A configuration from nameplates; what is not given is `unknown`, or listed as assumed.

    Parameters
    ----------
    bore, rod : diameters of a cylinder [m], with the same rod on both sides, or on side B alone if `single_rod`.
    stroke : full [m].
    rated_flow : of the valve [m³/s] at `rated_drop` over both edges [Pa].
    supply : pressure, absolute [Pa].
    table_mass : with rod and piston [kg].
    specimen_mass : on it [kg].
    hose_volume : of both lines together [m³].
    valve_frequency : at −90° of phase [Hz].
    valve_damping : [-].

    Raises
    ------
    ShakeError : a number that is not positive, or a rod as thick as the bore.

    Examples
    --------
    >>> import shake_ros as sr
    >>> made = sr.table(bore=0.05, rod=0.036, stroke=0.26, rated_flow=20 / 60000, supply=206e5, table_mass=450)
    >>> round(made.content["body"]["piston_area"] * 1e4, 2)
    9.46
    >>> made.content["valve"]["flow_coefficient"]["value"] * 1e7  # doctest: +ELLIPSIS
    1.78...
    >>> made.content["friction"]["viscous"]
    'unknown'
    """
    given = {"bore": bore, "rod": rod, "stroke": stroke, "rated_flow": rated_flow, "supply": supply}
    given |= {"rated_drop": rated_drop, "table_mass": table_mass}
    given |= {"valve_frequency": valve_frequency, "valve_damping": valve_damping}
    for name, value in given.items():
        if value is not None and not value > 0.0:
            raise ShakeError(f"{name} = {value:g}: expected a number above 0")
    content: dict[str, Any] = read_yaml(find("table", "unknown"))
    assumed = []
    body, valve, pressure = content["body"], content["valve"], content["supply"]
    area, ratio = _area(bore, None if single_rod else rod), _ratio(bore, rod) if single_rod else 1.0
    if area is None:
        assumed.append(f"piston_area {body['piston_area']:g} m² as a gauge: masses and forces are relative to it")
    else:
        body["piston_area"] = area
        if single_rod:
            body |= {"area_ratio": ratio, "volume_share": 1.0 / (1.0 + ratio)}
    if supply is None:
        assumed.append(f"supply_pressure {pressure['supply_pressure'] / 1e5:g} bar as a gauge")
    else:
        pressure["supply_pressure"] = supply
    assumed.append(f"tank_pressure {pressure['tank_pressure'] / 1e5:g} bar")
    if stroke is not None:
        body["stroke"] = stroke
        content["sensors"]["position_range"] = stroke
        if area is not None:
            body["cylinder_volume"] = _prior("body.cylinder_volume", 0.5 * (1.0 + ratio) * area * stroke + hose_volume)
            if not hose_volume:
                assumed.append("no oil in the lines between valve and cylinder")
    if table_mass is not None:
        body["table_mass"] = _prior("body.table_mass", table_mass)
    body["specimen_mass"] = specimen_mass
    if rated_flow is not None:
        valve["flow_coefficient"] = _prior("valve.flow_coefficient", rated_flow / math.sqrt(0.5 * rated_drop))
        assumed.append(f"rated flow at {rated_drop / 1e5:g} bar over both edges together")
    if valve_frequency is not None:
        valve["natural_frequency"] = _prior("valve.natural_frequency", 2.0 * math.pi * valve_frequency)
    if valve_damping is not None:
        valve["damping"] = _prior("valve.damping", valve_damping)
    assumed.append("friction, leakage, bulk modulus, dead time and the valve's centre from the recordings")
    return TableFile(content, tuple(assumed))


def _area(bore: float | None, rod: float | None) -> float | None:
    """Annular area [m²]."""
    if bore is None:
        return None
    if rod is not None and rod >= bore:
        raise ShakeError(f"rod = {rod:g} m: not thinner than the bore of {bore:g} m")
    return 0.25 * math.pi * (bore**2 - (rod or 0.0) ** 2)


def _ratio(bore: float | None, rod: float | None) -> float:
    """A_B/A_A of a cylinder with its rod on side B [-]."""
    if bore is None or rod is None:
        raise ShakeError("single_rod: needs the diameters of bore and rod")
    full, annular = _area(bore, None), _area(bore, rod)
    assert full is not None
    assert annular is not None
    return annular / full


def _prior(name: str, value: float) -> dict[str, float]:
    """A number with the standard deviation that nameplates of its kind have."""
    return {"value": float(f"{value:.6g}"), "sd": float(f"{SHARE[name] * value:.3g}")}
