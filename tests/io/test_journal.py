"""A file that changes at once: killed or refused at every single write to the disk."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io import journal
from mlsanm_cli.io.journal import JournaledFile, journal_of, opened, recover, shielded
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.run_reader import read_run
from tests.io.run_files import contact_record, datasets, start_run, step_record, write_steps


class Killed(BaseException):
    """Stands for the end of the process."""


class Disk:
    """Fails at the write number ``last``, of which half reaches the disk, and at every later one."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, last: int, error: BaseException) -> None:
        self.done = 0
        self._last, self._error = last, error
        self._pwrite, self._ftruncate, self._fallocate = os.pwrite, os.ftruncate, os.posix_fallocate
        monkeypatch.setattr(os, "pwrite", self.pwrite)
        monkeypatch.setattr(os, "ftruncate", self.ftruncate)
        monkeypatch.setattr(os, "posix_fallocate", self.fallocate)

    def _count(self) -> None:
        self.done += 1
        if self.done > self._last:
            raise self._error

    def pwrite(self, fd: int, content: Any, offset: int) -> int:
        if self.done + 1 == self._last + 1:
            self._pwrite(fd, content[: len(content) // 2], offset)
        self._count()
        return self._pwrite(fd, content, offset)

    def ftruncate(self, fd: int, size: int) -> None:
        # A full disk still lets files shrink.
        if isinstance(self._error, Killed):
            self._count()
        self._ftruncate(fd, size)

    def fallocate(self, fd: int, offset: int, size: int) -> None:
        self._count()
        self._fallocate(fd, offset, size)


def fails_somewhere(
    tmp_path: Path,
    error: BaseException,
    check: Callable[[Path], None],
    expected: type[BaseException],
    every: int,
) -> int:
    """Append a third step, with a failure at every so many writes in turn; how many writes there were."""
    for last in range(0, 1000, every):
        directory = tmp_path / str(last)
        directory.mkdir()
        run = start_run(directory / "run.h5")
        write_steps(run, range(2))
        with pytest.MonkeyPatch.context() as patch:
            disk = Disk(patch, last, error)
            try:
                write_steps(run, range(2, 3))
                assert disk.done <= last
                run.close()
                return last
            except expected:
                run.close()
        check(directory)
    raise AssertionError


def as_before_or_after(directory: Path) -> None:
    data = read_run(directory)
    assert data.path.rows in (2, 3)
    for step in range(data.path.rows):
        record = contact_record(step)
        np.testing.assert_array_equal(data.contacts["interface"].slip[step], record.slip)
    resumed = RunFile.reopen(directory / "run.h5", {}, rows=data.path.rows)
    assert journal_of(directory / "run.h5").stat().st_size == 0
    write_points(resumed)
    write_steps(resumed, range(data.path.rows, 5), seconds=9.0)
    resumed.close()
    data = read_run(directory)
    assert data.path.position.tolist() == [step_record(step).position for step in range(5)]
    with h5py.File(directory / "run.h5") as file:
        assert set(file["series"]) == {"0", "1", "2", "3", "4"}


def write_points(run: RunFile) -> None:
    """What `start_run` stores, once more."""
    line = np.linspace(-1.0, 1.0, 7)
    nodes = np.column_stack([line, line**2])
    run.write_contact("interface", nodes, np.tile([0.0, 1.0], (7, 1)), line + 1, np.full(7, 1 / 3))
    run.start_path(["squeeze", "press"], ["press", "block.bottom"])


def test_a_process_killed_at_any_write_leaves_a_whole_file(tmp_path: Path) -> None:
    assert fails_somewhere(tmp_path, Killed(), as_before_or_after, Killed, every=2) > 20


def test_a_disk_full_at_any_write_leaves_a_whole_file(tmp_path: Path) -> None:
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert fails_somewhere(tmp_path, full, as_before_or_after, RunError, every=5) > 20


def test_a_resumed_file_takes_nothing_but_the_same(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(3))
        run.write_fields(0.25, {"upper": {"von_mises": np.ones(5)}}, {"linear_residual": 1e-12})
    before = datasets(tmp_path / "run.h5")
    with RunFile.reopen(tmp_path / "run.h5", {}, rows=3, states=1) as run:
        run.write_case('title = "é"\n', "format = 1\n")
        write_points(run)
        run.confirm_attribute("cache_hash", "abc")
        with pytest.raises(RunError, match="cache_hash does not come out again"):
            run.confirm_attribute("cache_hash", "abd")
        with pytest.raises(RunError, match="series/2/pressure"):
            run.write_series(2, {"pressure": np.nextafter(np.full((21, 7), 2.0), 3.0)}, {})
        with pytest.raises(RunError, match="case/resolved"):
            run.write_case('title = "é"\n', "format = 2\n")
    np.testing.assert_equal(datasets(tmp_path / "run.h5"), before)


def test_pending_writes_are_read_back(tmp_path: Path) -> None:
    store = JournaledFile(tmp_path / "file", new=True)
    store.seek(3)
    store.write(b"abcdef")
    store.seek(5)
    store.write(b"XY")
    store.seek(0)
    assert store.read(12) == b"\0\0\0abXYef\0\0\0"
    assert (tmp_path / "file").stat().st_size == 0
    store.truncate(8)
    store.close()
    assert (tmp_path / "file").read_bytes() == b"\0\0\0abXYe"


def test_a_journal_cut_short_or_damaged_is_none(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with start_run(path) as run:
        write_steps(run, range(2))
    good = path.read_bytes()
    whole = journal._packed([(0, b"\0" * 64)], len(good), len(good))
    for content in (b"", whole[:10], whole[:-1], whole[:-1] + b"x"):
        journal_of(path).write_bytes(content)
        with opened(path) as file:
            assert len(file["path/position"]) == 2
    recover(path)
    assert path.read_bytes() == good
    journal_of(path).write_bytes(whole)
    with pytest.raises(OSError, match="no HDF5 file"), opened(path):
        pass
    recover(path)
    assert path.read_bytes()[:64] == b"\0" * 64


@pytest.mark.parametrize(
    "damage",
    [
        lambda whole: whole[: len(whole) // 2],
        lambda whole: whole[: len(whole) - 1],
        lambda whole: b"",
        lambda whole: b"\xff" * len(whole),
        lambda whole: whole[:8] + b"\xff" * 88 + whole[96:],
        lambda whole: whole[len(whole) // 2 :] + whole[: len(whole) // 2],
    ],
)
@pytest.mark.parametrize("beside", [True, False], ids=["journal", "alone"])
def test_a_damaged_file_is_told_by_name(
    damage: Callable[[bytes], bytes], beside: bool, tmp_path: Path
) -> None:
    path = tmp_path / "run.h5"
    with start_run(path) as run:
        write_steps(run, range(2))
    whole = path.read_bytes()
    kept = journal._packed([(len(whole) - 8, b"\0" * 8)], len(whole), len(whole))
    path.write_bytes(damage(whole))
    if beside:
        journal_of(path).write_bytes(kept)
    with pytest.raises(RunError, match=r"run\.h5 cannot be read: it is damaged"):
        read_run(tmp_path)
    with pytest.raises(RunError, match=r"run\.h5"):
        RunFile.reopen(path, {}, rows=2)
    # Nothing of it was written.
    assert path.read_bytes() == damage(whole)


def test_signals_wait_until_the_block_is_done() -> None:
    # A process in a shell's background is born deaf to SIGINT.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        _interrupted_in_a_block()
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupted_in_a_block() -> None:
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        with shielded():
            os.kill(os.getpid(), signal.SIGINT)
            held = True
        held = False
    assert held
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
