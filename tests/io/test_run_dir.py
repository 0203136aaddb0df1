"""The run directory: an earlier run is replaced on request only, and no foreign file is ever touched."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import EventLog, write_csv, write_json_atomic
from mlsanm_cli.io.run_dir import LOCK_FILE, holder, locked
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.schema import INTERFACE_COLUMNS

OURS = {"run.h5", "summary.json", "resolved.toml", "events.jsonl", "fields.pvd", "failure.vtu"}
OURS |= {"fields_0000.vtu", "fields_12345.vtu", "summary.json.tmp", "interface.csv", "interface_a%2Fb.csv"}
OURS |= {"plot_path.png", "path.csv"}
FOREIGN = {"notes.txt", "case.toml", "interface_notes.csv", "plot_mine.png", "fields_1.vtu", "other.vtu"}


def fill(directory: Path) -> None:
    directory.mkdir()
    for name in (OURS | FOREIGN) - {"run.h5"}:
        (directory / name).write_bytes(b"anything")
    columns = {name: np.zeros(2) for name in INTERFACE_COLUMNS}
    for name in ("interface.csv", "interface_a%2Fb.csv"):
        write_csv(directory / name, columns)
    (directory / "plot_path.png").write_bytes(b"\x89PNG Software mlsanm 0.1 ...")
    (directory / "fields_0007.vtu").mkdir()
    RunFile.create(directory / "run.h5", {}).close()


def names(directory: Path) -> set[str]:
    return {path.name for path in directory.iterdir()}


def test_a_new_directory_is_made_with_its_parents(tmp_path: Path) -> None:
    directory = tmp_path / "results" / "hertz"
    run_dir.check(directory, force=False)
    assert not (tmp_path / "results").exists()
    run_dir.prepare(directory, force=False)
    assert directory.is_dir()
    run_dir.prepare(directory, force=False)  # an empty one is as good


def test_an_earlier_run_is_kept_without_force(tmp_path: Path) -> None:
    fill(tmp_path / "run")
    before = names(tmp_path / "run")
    for function in (run_dir.check, run_dir.prepare):
        with pytest.raises(RunError, match="already holds a run") as caught:
            function(tmp_path / "run", force=False)
        assert "--force" in caught.value.hint
        assert "--out" in caught.value.hint
    assert names(tmp_path / "run") == before


def test_force_removes_what_mlsanm_wrote_and_nothing_else(tmp_path: Path) -> None:
    fill(tmp_path / "run")
    run_dir.check(tmp_path / "run", force=True)
    assert names(tmp_path / "run") == OURS | FOREIGN | {"fields_0007.vtu"}
    run_dir.prepare(tmp_path / "run", force=True)
    assert names(tmp_path / "run") == FOREIGN | {"fields_0007.vtu"}


def test_a_damaged_or_empty_run_file_counts_as_a_run(tmp_path: Path) -> None:
    RunFile.create(tmp_path / "run.h5", {}).close()
    for content in (b"", (tmp_path / "run.h5").read_bytes()[:60]):
        (tmp_path / "run.h5").write_bytes(content)
        with pytest.raises(RunError, match="already holds a run"):
            run_dir.prepare(tmp_path, force=False)
        run_dir.check(tmp_path, force=True)
    run_dir.prepare(tmp_path, force=True)
    assert names(tmp_path) == set()


def test_a_directory_with_other_files_needs_force_and_keeps_them(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(RunError, match="holds no run"):
        run_dir.prepare(tmp_path, force=False)
    run_dir.prepare(tmp_path, force=True)
    assert (tmp_path / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize("name", ["run.h5", "path.csv", "fields_0000.vtu", "interface.csv"])
def test_a_foreign_file_with_a_name_of_ours_is_never_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("of another program")
    for force in (False, True):
        with pytest.raises(RunError, match=f"holds {name}, but no run"):
            run_dir.prepare(tmp_path, force)
    assert (tmp_path / name).read_text() == "of another program"


def test_an_hdf5_file_of_another_program_is_not_a_run(tmp_path: Path) -> None:
    h5py.File(tmp_path / "run.h5", "w").close()
    with pytest.raises(RunError, match="no run of mlsanm"):
        run_dir.prepare(tmp_path, force=True)
    assert (tmp_path / "run.h5").exists()


def test_a_file_in_the_place_of_the_directory_or_above_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(RunError, match="is a file, not a directory"):
            run_dir.prepare(place, force=True)
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(RunError):
        run_dir.prepare(tmp_path / "dangling", force=True)


def test_a_place_without_permission_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(RunError, match="no permission"):
        run_dir.check(tmp_path / "new", force=False)


def compared(directory: Path) -> None:
    directory.mkdir(exist_ok=True)
    (directory / run_dir.COMPARISON_FILE).write_text('{"provenance": {"mlsanm": "0.1.0"}}')
    (directory / "plot_comparison.png").write_bytes(b"\x89PNG Software mlsanm 0.1 ...")


def test_a_comparison_lies_beside_a_run(tmp_path: Path) -> None:
    """Neither command removes the other's files or stumbles over them."""
    directory = tmp_path / "run"
    compared(directory)
    run_dir.prepare(directory, force=False)
    RunFile.create(directory / "run.h5", {}).close()
    run_dir.prepare(directory, force=True)
    assert names(directory) == {"comparison.json", "plot_comparison.png"}
    RunFile.create(directory / "run.h5", {}).close()
    with pytest.raises(RunError, match="already holds a comparison"):
        run_dir.prepare_comparison(directory, force=False)
    run_dir.prepare_comparison(directory, force=True)
    assert names(directory) == {"run.h5"}
    run_dir.prepare_comparison(directory, force=False)
    run_dir.prepare_comparison(tmp_path / "new" / "place", force=False)
    assert (tmp_path / "new" / "place").is_dir()


def test_a_comparison_touches_no_foreign_file(tmp_path: Path) -> None:
    directory = tmp_path / "mine"
    directory.mkdir()
    (directory / "notes.txt").write_text("mine")
    with pytest.raises(RunError, match="is not empty"):
        run_dir.check_comparison(directory, force=False)
    run_dir.check_comparison(directory, force=True)
    for name in ("comparison.json", "plot_comparison.png"):
        (directory / name).write_text("mine")
        with pytest.raises(RunError, match="not written by mlsanm"):
            run_dir.prepare_comparison(directory, force=True)
        assert (directory / name).read_text() == "mine"
        (directory / name).unlink()


def test_a_run_that_may_not_be_read_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run.h5").write_bytes(b"a run")

    def refuse(file: Path, *more: str, **options: bool) -> None:
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr("h5py.File", refuse)
    with pytest.raises(RunError, match=r"run\.h5 cannot be read: no permission"):
        run_dir.check(tmp_path, force=True)


ROOT = Path(__file__).parents[2]
HOLD = """
import sys, time
from pathlib import Path
from mlsanm_cli.io.run_dir import locked
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
