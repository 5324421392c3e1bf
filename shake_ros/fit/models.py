"""Every declared model by its name."""

from __future__ import annotations

from shake_ros.fit.axis_model import AXIS
from shake_ros.fit.records import FULL, DeclaredModel
from shake_ros.fit.reduced_model import REDUCED

MODELS: dict[str, DeclaredModel] = {model.name: model for model in (FULL, REDUCED, AXIS)}
