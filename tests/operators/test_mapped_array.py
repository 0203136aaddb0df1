"""Large arrays in files: they keep what was written, take memory one at a time, and do without a disk."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from mlsanm_cli.operators.linear import scratch
from mlsanm_cli.operators.linear.scratch import MappedArray

SIZE = 2**20


def resident() -> int:
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def all_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scratch, "MAPPED_SIZE", 0)


def filled(number: float) -> MappedArray:
    array = MappedArray(SIZE)
    array.values[:] = number
    return array


@pytest.mark.usefixtures("all_large")
def test_arrays_keep_their_numbers_while_others_are_used() -> None:
    arrays = [filled(float(number)) for number in range(4)]
    for _ in range(2):
        for number, array in enumerate(arrays):
            assert array.values.shape == (SIZE,)
            assert (array.values == number).all()
            array.values[0] = number
    del arrays[1:3]
    assert (arrays[1].values == 3.0).all()
    assert (arrays[0].values == 0.0).all()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is not told here")
@pytest.mark.usefixtures("all_large")
def test_only_the_last_one_is_in_memory() -> None:
    first = filled(1.0)
    before = resident()
    second = filled(2.0)
    assert resident() - before <= SIZE
    del first
    assert (second.values == 2.0).all()


@pytest.mark.usefixtures("all_large")
def test_a_full_disk_and_one_that_cannot_be_written_are_done_without(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    with monkeypatch.context() as patch:
        patch.setattr(os, "posix_fallocate", full)
        assert (filled(4.0).values == 4.0).all()
    with monkeypatch.context() as patch:
        patch.setattr(scratch, "DEFAULT_DIRECTORY", "/proc")
        patch.delenv("TMPDIR", raising=False)
        assert (filled(5.0).values == 5.0).all()
