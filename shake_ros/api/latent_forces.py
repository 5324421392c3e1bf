"""The forces that a model lacks, by recording, as `found.latent_force` gives them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from shake_ros.api.result_table import ResultTable
from shake_ros.core.discovery.latent_force import LatentForce


class LatentForces(Sequence[LatentForce]):
    """Histories of the force that the final model lacks: validation data first; by number or by recording."""

    def __init__(self, forces: Sequence[LatentForce]) -> None:
        self._forces = tuple(forces)

    def __len__(self) -> int:
        return len(self._forces)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return {force.recording: force for force in self._forces}[key]
        return self._forces[key]

    def __iter__(self) -> Iterator[LatentForce]:
        return iter(self._forces)

    @property
    def zero(self) -> bool:
        """Whether every force stays within its confidence band."""
        return all(force.kinds.zero for force in self)

    @property
    def frame(self) -> ResultTable:
        """A row for each recording."""
        heads = ("recording", "role", "rms", "peak", "unit", "of inertia", "kinds", "depends on")
        rows = [
            (
                force.recording,
                "validation" if force.held_out else "estimation",
                force.rms,
                force.peak,
                force.unit,
                force.of_inertia,
                "zero" if force.kinds.zero else ", ".join(force.kinds.kinds) or None,
                ", ".join(force.kinds.depends_on) or None,
            )
            for force in self
        ]
        return ResultTable(heads, rows)

    def __repr__(self) -> str:
        return repr(self.frame)

    def _repr_html_(self) -> str:
        return self.frame._repr_html_()
