"""run.h5: what cannot be written or read is refused, by name, and leaves what was there."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.run_reader import read_run
from tests.io.run_files import (
    M,
    contact_record,
    datasets,
    start_run,
    step_record,
    write_steps,
)


def test_a_bad_step_raises_before_anything_is_written(tmp_path: Path) -> None:
    good = step_record(1)
    wrong_shape = replace(contact_record(1), gap=np.ones(M + 1))
    bad: list[dict[str, Any]] = [
        {"factors": {"press": 1.0}},
        {"resultants": {**good.resultants, "press": np.ones(3)}},
        {"contacts": {}},
        {"contacts": {"interface": wrong_shape}},
        {"order": 2.5},
    ]
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(1))
        for change in bad:
            with pytest.raises(ValueError, match=r"expected|does not fit"):
                run.append_step(replace(good, **change))
    assert {len(array) for name, array in datasets(tmp_path / "run.h5").items() if "path/" in name} == {1}


def test_calls_out_of_order_and_wrong_shapes_are_refused(tmp_path: Path) -> None:
    with RunFile.create(tmp_path / "run.h5", {}) as run:
        with pytest.raises(ValueError, match="start_path"):
            run.append_step(step_record(0))
        with pytest.raises(ValueError, match="boundary names"):
            run.write_body("a", np.ones((3, 2)), np.array([0, 1]), np.ones((2, 2)), ["x"])
        with pytest.raises(ValueError, match="points of body"):
            run.write_body("a", np.ones((3, 3)), np.array([0]), np.ones((1, 2)), ["x"])
        with pytest.raises(ValueError, match="weight"):
            run.write_contact("c", np.ones((3, 2)), np.ones((3, 2)), np.ones(3), np.ones(4))
        run.start_path([], [])
        with pytest.raises(ValueError, match="started already"):
            run.start_path([], [])
    with start_run(tmp_path / "other.h5") as run:
        write_steps(run, range(1))
        with pytest.raises(ValueError, match="after the path was started"):
            run.write_contact("late", np.ones((1, 2)), np.ones((1, 2)), np.ones(1), np.ones(1))
        with pytest.raises(ValueError, match="negative"):
            run.write_series(-1, {}, {})


@pytest.mark.parametrize("name", ["", ".", "..", "a/b"])
def test_names_that_hdf5_would_take_for_paths_are_refused(tmp_path: Path, name: str) -> None:
    with RunFile.create(tmp_path / "run.h5", {}) as run, pytest.raises(RunError, match="cannot be stored"):
        run.write_body(name, np.ones((1, 2)), np.array([], int), np.empty((0, 2)), [])


def test_create_never_overwrites_and_reports_a_missing_directory(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_text("mine")
    with pytest.raises(RunError, match="exists already"):
        RunFile.create(path, {})
    assert path.read_text() == "mine"
    with pytest.raises(RunError, match="cannot write"):
        RunFile.create(tmp_path / "none" / "run.h5", {})


def test_an_exception_leaves_the_status_as_it_was_set(tmp_path: Path) -> None:
    def fail() -> None:
        with start_run(tmp_path / "run.h5") as run:
            write_steps(run, range(2))
            run.set_status("failed")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    data = read_run(tmp_path)
    assert (data.status, data.path.rows) == ("failed", 2)


ROOT = Path(__file__).parents[2]
FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from mlsanm_cli.errors import RunError
from tests.io.run_files import start_run, write_steps
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
run = start_run(Path(sys.argv[1]))
try:
    for step in range(100000):
        write_steps(run, range(step, step + 1))
        print(step, flush=True)
except RunError as error:
    print(error.message, flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on the size of files")
def test_a_full_disk_is_a_run_error_and_keeps_the_steps_before_it(tmp_path: Path) -> None:
    output = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path / "run.h5")],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    *steps, message = output.stdout.splitlines()
    assert message.startswith("cannot write "), output.stderr
    assert read_run(tmp_path).path.rows >= len(steps) > 50


def test_reader_names_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no such directory"):
        read_run(tmp_path / "none")
    with pytest.raises(RunError, match=r"holds no run\.h5"):
        read_run(tmp_path)
    path = tmp_path / "run.h5"
    path.write_bytes(b"not hdf5 at all")
    with pytest.raises(RunError, match="damaged, or being written"):
        read_run(tmp_path)
    path.unlink()
    with h5py.File(path, "w") as file:
        file.attrs["creator"] = "another program"
    with pytest.raises(RunError, match="not written by mlsanm"):
        read_run(tmp_path)
    path.unlink()
    RunFile.create(path, {"format": 2}).close()
    with pytest.raises(RunError, match="format 2"):
        read_run(tmp_path)


def test_reader_refuses_a_truncated_file(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(20))
    path = tmp_path / "run.h5"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(RunError, match="cannot be read"):
        read_run(path)
