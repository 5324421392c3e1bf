"""Gains from fewer neighbours of a table than a laboratory would ask for."""

from __future__ import annotations

from pathlib import Path

from shake_ros.settings import config_folder


def short_tuning(folder: Path, tables: int) -> str:
    """Path of the default settings of `tune` with so many neighbours, in `folder`."""
    text = (config_folder() / "robust_tuning.yaml").read_text(encoding="utf-8")
    assert "tables: 8 " in text
    path = folder / "short_tuning.yaml"
    path.write_text(text.replace("tables: 8 ", f"tables: {tables} "), encoding="utf-8")
    return str(path)
