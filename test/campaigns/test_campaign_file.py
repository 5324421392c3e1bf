"""The file of a campaign: one writer, no row twice, nothing of others touched."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from shake_ros.campaigns.campaign import FILE, CampaignFile
from shake_ros.quantities import ShakeError

ROW = ("key", '{"seed":1}', "v1", '{"sum": 0.1}', None, 1.0, 0.9, "machine 1")


def test_rows_are_there_again_when_it_is_opened_again(tmp_path):
    with CampaignFile(tmp_path / "new", "m:f") as file:
        file.add([ROW])
    with CampaignFile(tmp_path / "new", "m:f") as file:
        (row,) = file
        assert "key" in file
        assert (row.given, row.value("sum"), row.value("seed"), row.value("none")) == ({"seed": 1}, 0.1, 1, None)


def test_a_row_is_written_once(tmp_path):
    with CampaignFile(tmp_path, "m:f") as file:
        file.add([ROW])
        with pytest.raises(ShakeError, match="cannot be written"):
            file.add([("other", *ROW[1:]), ROW])
        assert len(file) == 1


def test_failed_rows_can_be_forgotten_by_version(tmp_path):
    with CampaignFile(tmp_path, "m:f") as file:
        failed = (None, "ValueError: no", 1.0, 0.9, "")
        file.add([ROW, ("a", "{}", "v1", *failed), ("b", "{}", "v0", *failed)])
        assert file.forget_failed("v1") == 1
        assert [key in file for key in ("key", "a", "b")] == [True, False, True]


def test_rows_written_before_a_kill_are_kept(tmp_path):
    program = f"""
import os, signal
from pathlib import Path
from shake_ros.campaigns.campaign import CampaignFile
file = CampaignFile(Path({str(tmp_path)!r}), "m:f")
file.add([{ROW!r}])
os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run(
        [sys.executable, "-c", program], check=False, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    with CampaignFile(tmp_path, "m:f") as file:
        assert [row.value("sum") for row in file] == [0.1]


def test_two_campaigns_do_not_share_a_folder(tmp_path):
    with CampaignFile(tmp_path, "m:f"):
        with pytest.raises(ShakeError, match="another campaign is running"):
            CampaignFile(tmp_path, "m:f")
        with CampaignFile(tmp_path, write=False) as reader:
            assert len(reader) == 0


def test_a_folder_of_something_else_is_refused_and_kept(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(ShakeError, match="not a folder of a campaign"):
        CampaignFile(tmp_path, "m:f")
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_rows_of_another_study_are_refused(tmp_path):
    with CampaignFile(tmp_path, "m:f"):
        pass
    with pytest.raises(ShakeError, match="rows of another study, of m:f"):
        CampaignFile(tmp_path, "m:g")


@pytest.mark.parametrize("content", [b"no database at all, of some length", b""])
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: bytes):
    (tmp_path / FILE).write_bytes(content)
    if content:
        with pytest.raises(ShakeError, match="cannot be used"):
            CampaignFile(tmp_path, "m:f")
    else:  # SQLite takes an empty file for an empty database, and so do we
        with CampaignFile(tmp_path, "m:f") as file:
            assert len(file) == 0


def test_a_database_of_others_is_refused_and_kept(tmp_path):
    base = sqlite3.connect(tmp_path / FILE)
    base.execute("CREATE TABLE letters (text)")
    base.commit()
    base.close()
    with pytest.raises(ShakeError, match="cannot be used"):
        CampaignFile(tmp_path, "m:f")
