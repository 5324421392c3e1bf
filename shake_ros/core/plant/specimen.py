"""The specimen in a table's record: what a copy of the table that is running carries can be changed between samples."""

from __future__ import annotations

import math

from shake_ros.core.compiled import njit


@njit
def set_load(model, rigid, swaying, pitch):  # type: ignore[no-untyped-def]
    """Give a table's record another specimen, in place.

    Parameters
    ----------
    model : array of one record. rigid, swaying : masses that stand rigidly, and on a spring [kg].
    pitch : logarithm of the frequency of that spring in Hz
    """
    p = model[0]
    p.body_specimen_mass = rigid + swaying
    p.specimen_resonance_mass = swaying
    p.specimen_resonance_frequency = math.exp(pitch)
