"""`figures`: the thesis's figures drawn again from the equations in the package."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shake_ros.core.effects import EFFECTS
from shake_ros.core.quantities import unknown_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ALL = "all"


@dataclass(frozen=True)
class Drawing:
    """A figure: the module and function that draw it, `module:function`, and what it shows in a line."""

    drawn_by: str
    line: str


FIGURES: dict[str, Drawing] = {
    "2.4": Drawing("shake_ros.thesis.figures_laws:entrained_air", "bulk modulus with entrained air, four models"),
    "2.5": Drawing("shake_ros.thesis.figures_laws:empirical", "empirical formulas for the bulk modulus"),
    "3.6": Drawing("shake_ros.thesis.figures_laws:curves", "steady friction of all laws against velocity"),
    "3.7": Drawing("shake_ros.thesis.figures_laws:lag", "frictional lag"),
    "3.8": Drawing("shake_ros.thesis.figures_laws:reversal", "hysteresis with velocity"),
    "3.9": Drawing("shake_ros.thesis.figures_laws:presliding", "pre-sliding displacement"),
    "3.10": Drawing("shake_ros.thesis.figures_laws:stick_slip", "stick-slip at 1 mm/s"),
    "break_away": Drawing("shake_ros.thesis.figures_laws:break_away", "break-away force against force rate"),
    "6.10": Drawing("shake_ros.thesis.figures_table:steps", "steps of the detailed and the simplified valve"),
    "6.11": Drawing("shake_ros.thesis.figures_table:second_order_step", "full step of the valve of table 6.4"),
    "valve_frequency": Drawing(
        "shake_ros.thesis.figures_table:frequency_response", "frequency response of both valves"
    ),
    "describing_functions": Drawing(
        "shake_ros.thesis.figures_table:describing_functions", "gain and phase of the table over amplitude (4.3)"
    ),
    "oil_spring": Drawing("shake_ros.thesis.figures_table:oil_spring", "frequency of the oil column along the stroke"),
    "flow_force": Drawing(
        "shake_ros.thesis.figures_table:flow_force", "axial flow force, and steps of the spool with it"
    ),
    **{
        name: Drawing("shake_ros.thesis.figures_table:effect_figure", f"what {name} does to a 2 Hz and a 5 Hz sine")
        for name in EFFECTS
        if "full" in EFFECTS[name].models and name != "unlisted"
    },
}


def known_figures(names: Sequence[str]) -> list[str]:
    """The names once each, or all of them; raises UnknownName."""
    for name in names:
        if name not in (*FIGURES, ALL):
            raise unknown_name("figure", name, [*FIGURES, ALL])
    return list(FIGURES) if ALL in names else list(dict.fromkeys(names))


def figures(*names: str) -> dict[str, Figure]:
    """Figures of the thesis, and what each effect does to the table.

    Parameters
    ----------
    names : numbers of figures as in the thesis, names of effects, or "all".

    Raises
    ------
    UnknownName
        With the figures there are.

    Examples
    --------
    >>> import shake_ros as sr
    >>> [len(figure.axes) for figure in sr.figures("2.4").values()]
    [4]
    """
    found = {}
    for name in known_figures(names):
        module, function = FIGURES[name].drawn_by.split(":")
        draw = getattr(importlib.import_module(module), function)
        found[name] = draw(name) if name in EFFECTS else draw()
    return found
