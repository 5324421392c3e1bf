"""A short run of benchmarks/fuzz_readers.py, and what a long one has found."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

import fuzz_readers  # noqa: E402
import fuzz_seeds  # noqa: E402


@pytest.mark.parametrize("name", fuzz_readers.READERS)
def test_broken_files_are_read_or_refused_with_one_line(name: str) -> None:
    counts, failures, _, _ = fuzz_readers.fuzz(name, 150, seed=7)
    assert failures == []
    assert sum(counts.values()) == 150
    assert counts["read"] and counts["refused"]


@pytest.mark.parametrize("name", fuzz_readers.READERS)
def test_every_sound_input_is_read(name: str, tmp_path: Path) -> None:
    reader = fuzz_readers.READERS[name]
    (tmp_path / "sound").mkdir()
    (tmp_path / "file").mkdir()
    for files in reader.make(tmp_path / "sound"):
        path = fuzz_readers.written(reader, files, tmp_path / "file")
        assert fuzz_readers.outcome(reader, path) == "read", list(files)


def test_an_input_depends_on_seed_and_number_alone() -> None:
    reader = fuzz_readers.READERS["accelerograms"]
    sound = fuzz_seeds.accelerograms()
    random.random()
    assert fuzz_readers.mutation(reader, sound, 3, 17) == fuzz_readers.mutation(reader, sound, 3, 17)
    assert fuzz_readers.mutation(reader, sound, 3, 17) != fuzz_readers.mutation(reader, sound, 3, 18)


def test_a_crash_a_hang_and_an_exception_are_told_from_each_other(monkeypatch, tmp_path: Path) -> None:
    def crash(path: Path) -> None:
        raise IndexError("not a clear line")

    reader = fuzz_readers.Reader(fuzz_readers.READERS["accelerograms"].make, fuzz_seeds.mutated_text, crash)
    assert "IndexError: not a clear line" in fuzz_readers.outcome(reader, tmp_path)

    def endless(path: Path) -> None:
        while True:
            pass

    monkeypatch.setattr(fuzz_readers, "LIMIT", 0.05)
    slow = fuzz_readers.Reader(reader.make, reader.mutate, endless)
    assert fuzz_readers.outcome(slow, tmp_path) == "hang"
