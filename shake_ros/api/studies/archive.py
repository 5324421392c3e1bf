"""The study `archive`: a laboratory's recordings in pairs; which tables changed, when, and by which parameter."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from shake_ros.api.identify import identify
from shake_ros.api.model import model
from shake_ros.api.read import read
from shake_ros.core.quantities import ShakeError

NAME = re.compile(r"(?P<table>.+)_(?P<when>[^_]+)_(?P<role>learn|hold)(\.mcap|\.db3)?")
ROLES = ("learn", "hold")


def pairs(folder: str) -> list[dict[str, Any]]:
    """The pairs of a folder, TABLE_WHEN_learn beside TABLE_WHEN_hold, by table and time.

    WHEN sorts as text, such as 2026-03-14.
    """
    root, found = Path(folder).expanduser(), dict[tuple[str, str], dict[str, str]]()
    if not root.is_dir():
        raise ShakeError(f"{folder}: is no folder")
    for path in sorted(root.iterdir()):
        name = NAME.fullmatch(path.name)
        if name:
            found.setdefault((name["table"], name["when"]), {})[name["role"]] = str(path)
    if not found:
        raise ShakeError(f"{folder}: no recording is named TABLE_WHEN_learn or TABLE_WHEN_hold")
    for (table, when), pair in found.items():
        for role in ROLES:
            if role not in pair:
                raise ShakeError(f"{folder}: {table}_{when}_{role} is missing beside the other of the pair")
    return [{"table": table, "when": when, **pair} for (table, when), pair in sorted(found.items())]


def fitted(table: str, when: str, learn: str, hold: str, config: str, kind: str = "full") -> dict[str, Any]:
    """The declared model fitted to one pair: its parameters with standard errors, and its errors.

    Parameters
    ----------
    table, when : whose and of which time, for the report. learn, hold : recordings. config : declared table.
    kind : of model.
    """
    assert table and when
    found = identify(model(kind, config), read(learn), read(hold), progress=False)
    errors = {
        f"{channel} error, {role}": max(e[channel] for e in runs.values())
        for role, runs in (("learn", found.fit.estimation), ("hold", found.fit.validation))
        for channel in ("velocity", "acceleration")
        if all(channel in e for e in runs.values())
    }
    return {
        **errors,
        "parameters": {
            p.name: {"value": p.value, "std_error": p.std_error, "unit": p.unit} for p in found.fit.parameters
        },
    }
