"""Every declared model by its name."""

from __future__ import annotations

from shake_ros.core.identification.axis_model import AXIS
from shake_ros.core.identification.recordings import FULL, DeclaredModel
from shake_ros.core.identification.reduced_model import REDUCED

MODELS: dict[str, DeclaredModel] = {model.name: model for model in (FULL, REDUCED, AXIS)}
