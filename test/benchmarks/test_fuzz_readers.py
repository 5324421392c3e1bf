"""A short run of benchmarks/recordings/fuzz.py, and what a long one has found."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from benchmarks.recordings import fuzz, seeds


@pytest.mark.parametrize("count", [50, pytest.param(1000, marks=pytest.mark.second_tier)])
@pytest.mark.parametrize("name", fuzz.READERS)
def test_broken_files_are_read_or_refused_with_one_line(name: str, count: int) -> None:
    counts, failures, _, _ = fuzz.fuzz(name, count, seed=7)
    assert failures == []
    assert sum(counts.values()) == count
    assert counts["read"] and counts["refused"]


@pytest.mark.parametrize("name", fuzz.READERS)
def test_every_sound_input_is_read(name: str, tmp_path: Path) -> None:
    reader = fuzz.READERS[name]
    (tmp_path / "sound").mkdir()
    (tmp_path / "file").mkdir()
    for files in reader.make(tmp_path / "sound"):
        path = fuzz.written(reader, files, tmp_path / "file")
        assert fuzz.outcome(reader, path) == "read", list(files)


def test_an_input_depends_on_seed_and_number_alone() -> None:
    reader = fuzz.READERS["accelerograms"]
    sound = seeds.accelerograms()
    random.random()
    assert fuzz.mutation(reader, sound, 3, 17) == fuzz.mutation(reader, sound, 3, 17)
    assert fuzz.mutation(reader, sound, 3, 17) != fuzz.mutation(reader, sound, 3, 18)


def test_a_crash_a_hang_and_an_exception_are_distinguished_from_each_other(monkeypatch, tmp_path: Path) -> None:
    def crash(path: Path) -> None:
        raise IndexError("not a clear line")

    reader = fuzz.Reader(fuzz.READERS["accelerograms"].make, seeds.mutated_text, crash)
    assert "IndexError: not a clear line" in fuzz.outcome(reader, tmp_path)

    def endless(path: Path) -> None:
        while True:
            pass

    monkeypatch.setattr(fuzz, "LIMIT", 0.05)
    slow = fuzz.Reader(reader.make, reader.mutate, endless)
    assert fuzz.outcome(slow, tmp_path) == "hang"
