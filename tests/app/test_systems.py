"""macOS and Windows as far as Linux can play them: functions are missing, and sizes have other units."""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path

import pytest

from mlsanm_cli import system
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.kernels.aot import kept
from mlsanm_cli.kernels.aot.machine import Code
from tests.app.processes import LONG, mlsanm
from tests.app.scenes import BAR

WITHOUT = """
import os, platform, signal, sys, types
import h5py, meshio, numpy, scipy.linalg  # which use what the system has
for name in sys.argv[1].split():
    module, _, attribute = name.rpartition(".")
    if module:
        delattr(sys.modules[module], attribute)
    else:
        sys.modules[name] = None
if "fcntl" in sys.argv[1]:
    windows = sys.modules["msvcrt"] = types.ModuleType("msvcrt")
    windows.LK_NBLCK, windows.locking = 2, lambda fd, mode, count: None
from mlsanm_cli.cli import main
code = main(sys.argv[2:])
sys.exit(code)
"""
WINDOWS = (
    "fcntl resource os.posix_fallocate os.sysconf os.getuid os.O_CLOEXEC "
    "os.O_NOFOLLOW os.O_NONBLOCK signal.SIGUSR1 signal.SIGALRM signal.setitimer"
)
"""Of these macOS lacks posix_fallocate."""


PROGRAM = ("-c", WITHOUT, WINDOWS)


def test_a_run_without_what_other_systems_lack(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(BAR)
    for arguments in (["run", "case.toml", "--out", "run", "--max-wall", "100"], ["info", "run"]):
        done = mlsanm(tmp_path, *arguments, program=PROGRAM)
        assert (done.returncode, "bug" in done.stderr) == (0, False), done.stderr
    assert read_run(tmp_path / "run").status == "done"


def test_a_wall_time_without_timers_of_the_system(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(LONG)
    done = mlsanm(tmp_path, "run", "case.toml", "--max-wall", "0.5", program=PROGRAM)
    assert done.returncode == 75, done.stderr
    assert "the wall time of 0.5 s is over" in done.stdout + done.stderr


def test_memory_in_the_unit_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    class Usage:
        ru_maxrss = 300 * 2**20

    monkeypatch.setattr(resource, "getrusage", lambda who: Usage)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert system.peak_memory_mb() == 300.0
    monkeypatch.setattr(sys, "platform", "linux")
    assert system.peak_memory_mb() == 300.0 * 1024.0


def test_kernels_are_kept_where_users_are_not_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "getuid")
    assert kept.read(tmp_path) is None
    code = Code(b"code", {}, (), ())
    kept.write(tmp_path / "kernels" / "place", code)
    assert kept.read(tmp_path / "kernels" / "place") == code


def test_directories_of_a_container_may_belong_to_its_host(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "a" / "b" / "c"
    place.mkdir(parents=True)
    (place / "file").write_text("")
    assert system.who_else_may_write(place / "file") == ""
    owned = {tmp_path / "a": 65534}
    real = Path.stat

    def stat(path: Path, **options: bool) -> os.stat_result:
        found = list(real(path, **options))
        found[4] = owned.get(path, found[4])
        return os.stat_result(found)

    monkeypatch.setattr(Path, "stat", stat)
    assert "belongs to another user" in system.who_else_may_write(place / "file")
    monkeypatch.setattr(system, "_overflow_user", lambda: 65534)
    assert system.who_else_may_write(place / "file") == ""
    # What lies nearest must be this user's own all the same.
    owned[place] = 65534
    assert "belongs to another user" in system.who_else_may_write(place / "file")
