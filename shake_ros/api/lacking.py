"""What the model of an iteration lacks, from the runs that it made: `close_loop` on the first and the last of them."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.api.progress import Progress, Told
from shake_ros.core.discovery import close_loop as closing
from shake_ros.core.discovery.search_settings import SearchSettings
from shake_ros.core.discovery.unlisted_functions import UNLISTED
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.declared import model_structure, search_settings


def lacking(
    model: TableParameters, runs: Sequence[Record], settings: SearchSettings | None = None, progress: Told = True
) -> str:
    """Which effect a model lacks, in a sentence, from at least two runs; the first is fitted, the last one judges.

    Parameters
    ----------
    model : of the feedforward. runs : with acceleration, oldest first.
    settings : of the search, where not those of config/discovery/search.yaml.
    """
    if len(runs) < 2:
        return "one run does not tell what the model lacks; close_loop needs two"
    with Progress("close_loop on the runs", progress) as bar:
        found = closing.close_loop(
            model_structure(model), runs[:1], runs[-1:], settings or search_settings(), bar
        ).standings
    if not found:
        return (
            "close_loop on the runs finds nothing that the model lacks: the gains do not suit this table, "
            "and ./shake tune designs them"
        )
    names = [s.effect for s in found if s.effect != UNLISTED]
    told = ", ".join(f"{s.effect} ({s.place}{_or(s.alternatives)})" for s in found)
    text = f"close_loop on the runs: the model lacks {told}"
    return f"{text}; --refit {' '.join(names)} fits it to the runs" if names else text


def _or(alternatives: Sequence[str]) -> str:
    """Effects that the runs cannot tell from one."""
    return f"; or {', '.join(alternatives)}" if alternatives else ""
