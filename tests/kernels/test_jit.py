"""Machine code of kernels: kept, loaded without numba, and compiled anew wherever there is any doubt.

The processes here have kernels of their own, few and small, in place of the package's.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels import blas
from mlsanm_cli.kernels.aot import kept
from tests.kernels.programs import KERNELS, MORE, ROOTS, answer, files, run, started


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the kernels above, kept by a user who lets others read."""
    path = tmp_path_factory.mktemp("cache")
    assert run(path, "import os; os.umask(0o022)" + ROOTS) == answer(warm=False, numba=True)
    return path


def copied(cache: Path, tmp_path: Path) -> Path:
    """The machine code in a directory of its own."""
    (source,) = files(cache)
    copy = tmp_path / source.relative_to(cache)
    copy.parent.mkdir(parents=True)
    copy.write_bytes(source.read_bytes())
    return copy


def test_kept_code_is_loaded_without_numba(cache: Path) -> None:
    before = [(path, path.stat().st_mtime_ns) for path in (*files(cache), *(cache / "kernels").iterdir())]
    assert run(cache, ROOTS) == answer(warm=True, numba=False)
    assert before == [(path, path.stat().st_mtime_ns) for path, _ in before]


@pytest.mark.parametrize("change", ["empty", "short", "bit", "head", "text"])
def test_damaged_code_is_not_read(change: str, cache: Path, tmp_path: Path) -> None:
    path = copied(cache, tmp_path)
    assert kept.read(path.parent) is not None
    data = bytearray(path.read_bytes())
    if change == "bit":
        data[len(data) // 2] ^= 1
    elif change == "head":
        data[0] ^= 1
    path.write_bytes(
        {"empty": b"", "short": bytes(data[:-1]), "text": b"machine code\n"}.get(change, bytes(data))
    )
    assert kept.read(path.parent) is None


def test_what_cannot_be_used_is_compiled_anew_by_several_processes_at_once(
    cache: Path, tmp_path: Path
) -> None:
    path = copied(cache, tmp_path)
    code = kept.read(path.parent)
    assert code is not None
    wrong = dataclasses.replace(code, symbols=(*code.symbols, "nobody_has_this"))
    kept.write(path.parent, wrong)
    processes = [started(tmp_path, KERNELS + ROOTS) for _ in range(2)]
    told = [process.communicate()[0].splitlines() for process in processes]
    assert all(lines[1].startswith("[1.0, 1.5] [0, 1, 2] 4 0.25") for lines in told)
    assert files(tmp_path) == [path]
    assert run(tmp_path, ROOTS) == answer(warm=True, numba=False)


def test_another_version_of_numba_has_code_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = kept.directory()
    (tmp_path / "_version.py").write_text("version = '9.9'")
    monkeypatch.setattr(kept, "numba_root", lambda: str(tmp_path))
    assert kept.directory() != usual


@pytest.mark.parametrize("lenient", ["file", "directory", "above"])
def test_code_that_others_may_have_written_is_not_loaded(lenient: str, cache: Path, tmp_path: Path) -> None:
    path = copied(cache, tmp_path)
    code = kept.read(path.parent)
    assert code is not None
    chosen = {"file": path, "directory": path.parent, "above": tmp_path}[lenient]
    chosen.chmod(0o777 if chosen.is_dir() else 0o666)
    assert kept.read(path.parent) is None
    # Our own directories are shut; one above them is not ours to change.
    if lenient == "above":
        with pytest.raises(PermissionError, match="others may write to"):
            kept.write(path.parent, code)
        assert kept.read(path.parent) is None
    else:
        kept.write(path.parent, code)
        assert kept.read(path.parent) is not None


def test_where_nothing_can_be_written_every_process_compiles_and_says_so(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    warm, told = run(blocked / "below", ROOTS)
    assert warm == "False"
    assert told.startswith("[1.0, 1.5] [0, 1, 2] 4 0.25 True compiled kernels cannot be kept")
    assert "MLSANM_CACHE_DIR" in told
    assert blocked.read_text() == "not a directory"


USES = """
def pages():
    # Not the largest ever: a process inherits that of the one that started it.
    return int(open("/proc/self/statm").read().split()[1])

first = ones(3, 100_000)
kept_part = first[1, 5:8]
del first
before = pages()
for _ in range(40):
    assert ones(3, 100_000).sum() == 3e5
# All of them together are 96 MB.
print(kept_part.tolist(), (pages() - before) * resource.getpagesize() < 20_000_000)
x = np.arange(6.0).reshape(3, 2)
part = same(x)
x[:] = -1.0
print(part.tolist(), ones(0, 5).shape, ones(2, 0).shape)
y, z = np.zeros(4), np.array([1.0, 2.0, 3.0, 4.0])
square(z)
print(filled(y), y.tolist(), z.tolist(), "numba" in sys.modules)
for call in (lambda: ones(2**40, 2**10), lambda: ones(-1, 1), lambda: assigned(np.ones(3), np.ones(2))):
    try:
        call()
    except Exception as error:
        print(type(error).__name__, error)
"""


def test_results_live_as_long_as_they_are_used_and_exceptions_are_raised(tmp_path: Path) -> None:
    for numba in (True, False):
        *told, memory, negative, shapes = run(tmp_path, MORE + USES)
        assert told == [
            *("[1.0, 1.0, 1.0] True", "[2.0, 3.0] (0, 5) (2, 0)"),
            f"None [7.0, 7.0, 7.0, 7.0] [7.0, 10.0, 15.0, 22.0] {numba}",
        ]
        assert memory.startswith("MemoryError Allocation failed")
        assert negative.startswith("ValueError negative dimensions")
        assert shapes.startswith("RuntimeError __main__.assigned: ValueError")


def test_functions_of_scipy_are_called_as_they_are_declared() -> None:
    for external in blas.EXTERNALS:
        assert external.address()
        wrong = dataclasses.replace(external, arguments=external.arguments.replace("i", "l"))
        with pytest.raises(RunError, match=f"has a {external.name} that kernels cannot call: void"):
            wrong.address()
