"""Arrays on disk: whole or not at all, checked, limited, and never the end of a run."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.io.store import SUFFIX, Arrays, Store, packed

ARRAYS = {"observed": np.arange(2000.0).reshape(40, 50), "solution": np.zeros((3, 0))}


def store(directory: Path, limit: float = 1e9, said: list[str] | None = None) -> Store:
    """A store whose messages are kept."""
    return Store(directory, int(limit), (said if said is not None else []).append)


def same(found: Arrays | None) -> bool:
    """Whether arrays read are those written."""
    if found is None or found.keys() != ARRAYS.keys():
        return False
    return all(np.array_equal(found[name], ARRAYS[name]) for name in ARRAYS)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    said: list[str] = []
    one = store(tmp_path / "deep" / "er", said=said)
    assert one.read("a/b") is None
    one.write("a/b", ARRAYS)
    assert same(store(tmp_path / "deep" / "er").read("a/b"))
    assert one.usage().entries == 1
    assert one.clear().entries == 1
    assert one.read("a/b") is None
    assert not said


def _flip(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :]


@pytest.mark.parametrize(
    "spoil",
    [
        *(lambda content, at=at: _flip(content, at) for at in (0, 25, 60, 200, 9000, 16000)),
        lambda content: content[:-1],
        lambda content: content[:30],
        lambda content: b"",
        lambda content: content + b"\0",
        lambda content: packed(ARRAYS, "another"),
    ],
)
def test_damage_is_found_told_once_and_repaired(tmp_path: Path, spoil: Callable[[bytes], bytes]) -> None:
    said: list[str] = []
    one = store(tmp_path, said=said)
    for name in ("a", "b"):
        one.write(name, ARRAYS)
        path = tmp_path / f"{name}{SUFFIX}"
        assert same(one.read(name))
        path.write_bytes(spoil(path.read_bytes()))
        assert one.read(name) is None
        assert not path.exists()
    assert len(said) == 1
    assert "damaged" in said[0]
    one.write("a", ARRAYS)
    assert same(one.read("a"))


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path) -> None:
    size = len(packed(ARRAYS, "a"))
    one = store(tmp_path, 3.5 * size)
    for age, name in enumerate("abc"):
        one.write(name, ARRAYS)
        os.utime(tmp_path / f"{name}{SUFFIX}", (1000.0 + age, 1000.0 + age))
    assert same(one.read("a"))  # used just now
    one.write("d", ARRAYS)
    assert [one.read(name) is not None for name in "abcd"] == [True, False, True, True]
    assert one.usage().bytes <= 3.5 * size


def test_nothing_larger_than_the_limit_is_kept(tmp_path: Path) -> None:
    said: list[str] = []
    one = store(tmp_path, 100, said)
    one.write("a", ARRAYS)
    assert one.usage().entries == 0
    assert not said


def test_abandoned_files_are_swept_up_and_living_ones_left(tmp_path: Path) -> None:
    old, new = (tmp_path / f"x{SUFFIX}.{name}.tmp" for name in ("old", "new"))
    for path in (old, new):
        path.write_bytes(b"half")
    os.utime(old, (1000.0, 1000.0))
    store(tmp_path).write("a", ARRAYS)
    assert (old.exists(), new.exists()) == (False, True)


def test_a_place_that_cannot_be_used_is_told_of_once(tmp_path: Path) -> None:
    said: list[str] = []
    (tmp_path / "file").write_text("no directory")
    one = store(tmp_path / "file" / "below", said=said)
    for name in "ab":
        one.read(name)
        one.write(name, ARRAYS)
    assert len([text for text in said if "MLSANM_CACHE_DIR" in text]) == 1
    assert len(said) <= 2
    assert (tmp_path / "file").read_text() == "no directory"


def _write_and_read(directory: Path, count: int) -> None:
    said: list[str] = []
    one = store(directory, said=said)
    for _ in range(count):
        one.write("shared", ARRAYS)
        assert same(one.read("shared"))
    assert not said


def test_many_processes_write_one_entry_at_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_and_read, args=(tmp_path, 40)) for _ in range(8)]
    for process in writers:
        process.start()
    for process in writers:
        process.join()
    assert [process.exitcode for process in writers] == [0] * 8
    assert [path.name for path in tmp_path.iterdir()] == [f"shared{SUFFIX}"]
