"""An accelerogram from the operator's machine becomes a reference that the generator can play."""

from __future__ import annotations

from pathlib import Path

import yaml

from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.reference_program import build_program
from shake_ros.page.library import checked_name
from shake_ros.settings import find, read_yaml

LARGEST = 8 * 1024 * 1024  # bytes of an accelerogram
TEMPLATE = "earthquake"  # the reference whose band and limits it gets
SUFFIXES = (".at2", ".v2", ".v2c", ".smc", ".txt", ".csv", ".dat")


def make_reference(folder: Path, name: str, content: bytes, unit: str, sample_time: float) -> Path:
    """Store the record, write a reference that plays it, and try it; ShakeError where it cannot be played."""
    checked_name(name)
    if len(content) > LARGEST:
        raise ShakeError(f"{name}: larger than {LARGEST // 1024 // 1024} MiB")
    if Path(name).suffix.lower() not in SUFFIXES:
        raise ShakeError(f"{name}: not an accelerogram ({', '.join(SUFFIXES)})")
    folder.mkdir(parents=True, exist_ok=True)
    record, reference = folder / name, folder / f"{Path(name).stem}.yaml"
    record.write_bytes(content)
    try:
        read_accelerogram(record, unit=unit)
        settings = {**read_yaml(find("reference", TEMPLATE)), "record": str(record), "unit": unit}
        reference.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
        build_program(str(reference), sample_time)
    except ShakeError as error:
        record.unlink(missing_ok=True)
        reference.unlink(missing_ok=True)
        raise ShakeError(str(error).replace(f"{folder}/", "")) from None
    return reference
