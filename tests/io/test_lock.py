"""One process at a time in a run directory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import LOCK_FILE, holder, locked
from mlsanm_cli.io.summary import EventLog, write_json_atomic

ROOT = Path(__file__).parents[2]
HOLD = """
import sys, time
from pathlib import Path
from mlsanm_cli.io.files import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_process_is_refused_and_told_who_holds_it(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert holder(tmp_path).startswith(f"process {process.pid} on ")
        with pytest.raises(RunError, match=f"by process {process.pid} on "), locked(tmp_path):
            pass
        with pytest.raises(RunError, match=f"process {process.pid}"):
            run_dir.check(tmp_path, force=True)
        process.kill()
    # What a dead process leaves holds nobody up.
    assert (tmp_path / LOCK_FILE).exists()
    assert holder(tmp_path) == ""
    run_dir.check(tmp_path, force=False)
    with locked(tmp_path):
        assert holder(tmp_path).startswith(f"process {os.getpid()} on ")
        run_dir.prepare(tmp_path, force=True)
    assert list(tmp_path.iterdir()) == []


def test_a_lock_taken_on_a_file_that_was_removed_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = os.open
    removed: list[Path] = []

    def open_(path: Path, *arguments: int) -> int:
        fd = opened(path, *arguments)
        if not removed:
            path.unlink()
            removed.append(path)
        return fd

    monkeypatch.setattr(os, "open", open_)
    with locked(tmp_path):
        assert (tmp_path / LOCK_FILE).is_file()


def test_a_directory_that_cannot_be_made_is_a_run_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match="cannot write"), locked(tmp_path / "file" / "run"):
        pass


def test_a_link_or_a_pipe_in_the_place_of_the_lock_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("mine")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / LOCK_FILE).symlink_to(target)
    (tmp_path / "b").mkdir()
    os.mkfifo(tmp_path / "b" / LOCK_FILE)
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / LOCK_FILE).hardlink_to(target)
    for name, words in (("a", "symbolic link"), ("b", "pipe"), ("c", "hard link")):
        assert holder(tmp_path / name) == ""
        with pytest.raises(RunError, match=words) as caught, locked(tmp_path / name):
            pass
        assert caught.value.hint.startswith("remove it")
    assert target.read_text() == "mine"


@pytest.mark.parametrize("name", ["events.jsonl", "summary.json.tmp"])
def test_links_in_a_run_directory_are_not_followed(name: str, tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("mine\nand yours")
    (tmp_path / name).symlink_to(target)
    if name == "events.jsonl":
        with pytest.raises(RunError, match="symbolic link"):
            EventLog(tmp_path / name)
    write_json_atomic(tmp_path / "summary.json", {"a": 1})
    assert target.read_text() == "mine\nand yours"
