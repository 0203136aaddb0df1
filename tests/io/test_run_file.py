"""run.h5: layout, equality of equal runs, reading while it is written, and what a kill leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import ContactRecord, RunFile, StepRecord
from mlsanm_cli.io.run_reader import read_run

TESTS = str(Path(__file__).parent)
ROOT = Path(__file__).parents[2]
M = 7  # slave nodes of the contact
LOADS = ["squeeze", "press"]
RESULTANTS = ["press", "block.bottom"]


def contact_record(step: int) -> ContactRecord:
    base = np.linspace(0.0, 1.0, M) + step
    return ContactRecord(
        pressure=base,
        traction=base + 0.1,
        gap=base + 0.2,
        slip=base + 0.3,
        status=np.array([0, 1, 2, 0, 1, 2, step % 3], dtype=np.int8),
    )


def step_record(step: int, seconds: float = 0.5) -> StepRecord:
    return StepRecord(
        position=step / 8,
        step_length=0.125,
        residual=1e-9 * step,
        order=20,
        factorizations=step,
        solves=20 * step,
        seconds=seconds,
        factors={"press": step / 8, "squeeze": 1.0},
        resultants={"press": np.array([0.0, -step]), "block.bottom": np.array([0.5, step])},
        contacts={"interface": contact_record(step)},
    )


def start_run(path: Path) -> RunFile:
    run = RunFile.create(path, {"argv": "mlsanm run a.toml", "threads": 1, "wall_limit": 2.5})
    run.write_case('title = "é"\n', "format = 1\n")
    points = np.arange(10.0).reshape(5, 2)
    run.write_body("upper", points, np.array([0, 3]), np.array([[0.0, 1.0], [1.0, 0.0]]), ["arc", "flat"])
    run.write_body("block", points + 1, np.array([4]), np.array([[0.0, -1.0]]), ["bottom"])
    line = np.linspace(-1.0, 1.0, M)
    nodes = np.column_stack([line, line**2])
    run.write_contact("interface", nodes, np.tile([0.0, 1.0], (M, 1)), line + 1, np.full(M, 1 / 3))
    run.start_path(LOADS, RESULTANTS)
    return run


def write_steps(run: RunFile, steps: range, seconds: float = 0.5) -> None:
    for step in steps:
        coefficients = np.full((21, M), float(step))
        run.write_series(step, {"pressure": coefficients}, {"length": 0.125, "start": step / 8})
        run.append_step(step_record(step, seconds))
        run.commit()


def datasets(path: Path) -> dict[str, np.ndarray]:
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None
        )
    return found


def test_layout_shapes_and_types_of_every_path(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(4))
        assert run.write_fields(0.25, {"upper": {"stress": np.ones((5, 3)), "von_mises": np.ones(5)}}) == 0
        assert run.write_fields(0.5, {"upper": {"displacement": np.ones((5, 2))}}) == 1
        run.set_status("done")
    found = {
        name: (array.shape, array.dtype.kind + str(array.dtype.itemsize))
        for name, array in datasets(tmp_path / "run.h5").items()
    }
    assert found == {
        "case/raw": ((), "O8"),
        "case/resolved": ((), "O8"),
        "bodies/upper/points": ((5, 2), "f8"),
        "bodies/upper/boundary/index": ((2,), "i8"),
        "bodies/upper/boundary/normal": ((2, 2), "f8"),
        "bodies/upper/boundary/name": ((2,), "O8"),
        "bodies/block/points": ((5, 2), "f8"),
        "bodies/block/boundary/index": ((1,), "i8"),
        "bodies/block/boundary/normal": ((1, 2), "f8"),
        "bodies/block/boundary/name": ((1,), "O8"),
        "path/position": ((4,), "f8"),
        "path/step_length": ((4,), "f8"),
        "path/residual": ((4,), "f8"),
        "path/order": ((4,), "i8"),
        "path/factorizations": ((4,), "i8"),
        "path/solves": ((4,), "i8"),
        "path/seconds": ((4,), "f8"),
        "path/factors/press": ((4,), "f8"),
        "path/factors/squeeze": ((4,), "f8"),
        "path/resultants/press": ((4, 2), "f8"),
        "path/resultants/block.bottom": ((4, 2), "f8"),
        "contacts/interface/points": ((M, 2), "f8"),
        "contacts/interface/normal": ((M, 2), "f8"),
        "contacts/interface/arc_length": ((M,), "f8"),
        "contacts/interface/weight": ((M,), "f8"),
        "contacts/interface/pressure": ((4, M), "f8"),
        "contacts/interface/traction": ((4, M), "f8"),
        "contacts/interface/gap": ((4, M), "f8"),
        "contacts/interface/slip": ((4, M), "f8"),
        "contacts/interface/status": ((4, M), "i1"),
        "contacts/interface/dissipated_work": ((4,), "f8"),
        "series/0/pressure": ((21, M), "f8"),
        "series/1/pressure": ((21, M), "f8"),
        "series/2/pressure": ((21, M), "f8"),
        "series/3/pressure": ((21, M), "f8"),
        "fields/0/upper/stress": ((5, 3), "f8"),
        "fields/0/upper/von_mises": ((5,), "f8"),
        "fields/1/upper/displacement": ((5, 2), "f8"),
        "fields/position": ((2,), "f8"),
    }
    with h5py.File(tmp_path / "run.h5", "r") as file:
        assert dict(file.attrs) == {
            "format": 1,
            "mlsanm_version": __version__,
            "status": "done",
            "argv": "mlsanm run a.toml",
            "threads": 1,
            "wall_limit": 2.5,
        }
        assert dict(file["series/3"].attrs) == {"length": 0.125, "start": 0.375}


def test_reader_gives_back_what_was_written_in_the_order_of_the_case(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(5))
        run.write_fields(0.5, {"upper": {"von_mises": np.arange(5.0)}, "block": {"von_mises": np.ones(5)}})
        run.set_status("done")
    data = read_run(tmp_path)
    assert data.status == "done"
    assert data.directory == tmp_path
    assert (data.case_raw, data.case_resolved) == ('title = "é"\n', "format = 1\n")
    assert list(data.bodies) == ["upper", "block"]
    assert data.bodies["upper"].boundary_name == ("arc", "flat")
    assert list(data.path.factors) == LOADS
    assert list(data.path.resultants) == RESULTANTS
    np.testing.assert_array_equal(data.path.position, np.arange(5) / 8)
    np.testing.assert_array_equal(data.path.resultants["block.bottom"][:, 1], np.arange(5))
    contact = data.contacts["interface"]
    for step in range(5):
        expected = contact_record(step)
        for key in ("pressure", "traction", "gap", "slip", "status"):
            np.testing.assert_array_equal(getattr(contact, key)[step], getattr(expected, key))
    assert [state.position for state in data.states] == [0.5]
    assert list(data.states[0].bodies) == ["upper", "block"]
    np.testing.assert_array_equal(data.states[0].bodies["upper"]["von_mises"], np.arange(5.0))


def test_rows_survive_many_chunks(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(600))
    data = read_run(tmp_path)
    np.testing.assert_array_equal(data.path.solves, 20 * np.arange(600))
    np.testing.assert_array_equal(data.contacts["interface"].slip[:, 0], np.arange(600) + 0.3)


def test_equal_runs_give_equal_arrays_but_for_seconds(tmp_path: Path) -> None:
    for name, seconds in (("a", 0.5), ("b", 0.75)):
        with start_run(tmp_path / f"{name}.h5") as run:
            write_steps(run, range(6), seconds)
            run.write_fields(0.5, {"upper": {"von_mises": np.arange(5.0)}})
    first, second = datasets(tmp_path / "a.h5"), datasets(tmp_path / "b.h5")
    assert first.keys() == second.keys()
    different = {
        name
        for name in first
        if first[name].dtype != second[name].dtype or first[name].tolist() != second[name].tolist()
    }
    assert different == {"path/seconds"}


def test_a_run_without_contacts_loads_or_candidates_can_be_stored(tmp_path: Path) -> None:
    with RunFile.create(tmp_path / "run.h5", {}) as run:
        empty = np.empty(0)
        run.write_contact("far", np.empty((0, 2)), np.empty((0, 2)), empty, empty)
        run.start_path([], [])
        nothing = ContactRecord(empty, empty, empty, empty, np.empty(0, np.int8))
        for _ in range(2):
            run.append_step(StepRecord(0.0, 0.0, 0.0, 1, 1, 1, 0.0, {}, {}, {"far": nothing}))
    data = read_run(tmp_path)
    assert data.path.rows == 2
    assert data.contacts["far"].pressure.shape == (2, 0)
    assert data.states == ()


def test_other_programs_read_each_flushed_step_while_the_run_goes_on(tmp_path: Path) -> None:
    code = (
        "import sys, h5py\n"
        "with h5py.File(sys.argv[1], 'r') as f:\n"
        "    print(f.attrs['status'], len(f['path/position']), f['contacts/interface/pressure'][-1, 0],"
        " len(f['series']))"
    )
    run = start_run(tmp_path / "run.h5")
    for count in (1, 3):
        write_steps(run, range(count - 1 if count == 1 else 1, count))
        output = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / "run.h5")], capture_output=True, text=True, check=True
        )
        assert output.stdout.split() == ["running", str(count), str(count - 1.0), str(count)]
        assert read_run(tmp_path).path.rows == count
    run.close()


KILLED = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from test_run_file import start_run, write_steps
run = start_run(Path(sys.argv[1]))
for step in range(100000):
    write_steps(run, range(step, step + 1))
    print(step, flush=True)
"""


def test_a_killed_run_keeps_every_step_it_reported(tmp_path: Path) -> None:
    for trial, wanted in enumerate((1, 40, 300)):
        directory = tmp_path / str(trial)
        directory.mkdir()
        process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                KILLED.format(tests=TESTS),
                str(directory / "run.h5"),
            ],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        assert process.stdout is not None
        with process, process.stdout:
            for line in process.stdout:
                if int(line) >= wanted:
                    break
            process.send_signal(signal.SIGKILL)
            reported = max([int(line), *(int(rest) for rest in process.stdout if rest.endswith("\n"))])
        assert process.returncode == -signal.SIGKILL
        data = read_run(directory)
        assert data.status == "running"
        # One step may have reached the disk and not the pipe.
        assert data.path.rows in (reported + 1, reported + 2)
        contact = data.contacts["interface"]
        for step in range(data.path.rows):
            np.testing.assert_array_equal(contact.pressure[step], contact_record(step).pressure)
        with h5py.File(directory / "run.h5", "r") as file:
            assert {str(step) for step in range(data.path.rows)} <= set(file["series"])


def test_reader_cuts_ragged_rows_and_close_drops_them(tmp_path: Path) -> None:
    """A kill inside a flush may leave one dataset a row ahead; an exception inside append_step too."""
    run = start_run(tmp_path / "run.h5")
    write_steps(run, range(3))
    columns = run._history._columns
    columns["position"].write(3, columns["position"].checked(9.0))
    columns["contacts/interface/gap"].write(3, columns["contacts/interface/gap"].checked(np.ones(M)))
    run._file.flush()
    data = read_run(tmp_path)
    assert data.path.rows == 3
    assert data.contacts["interface"].gap.shape == data.contacts["interface"].slip.shape == (3, M)
    run.close()
    run.close()
    assert datasets(tmp_path / "run.h5")["path/position"].tolist() == [0.0, 0.125, 0.25]


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


FULL_DISK = """
import resource, signal, sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from mlsanm_cli.errors import RunError
from test_run_file import start_run, write_steps
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
        [sys.executable, "-c", FULL_DISK.format(tests=TESTS), str(tmp_path / "run.h5")],
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


def test_a_run_killed_before_its_path_began_reads_as_empty(tmp_path: Path) -> None:
    run = RunFile.create(tmp_path / "run.h5", {})
    data = read_run(tmp_path)
    run.close()
    assert (data.status, data.path.rows, data.case_raw, dict(data.bodies)) == ("running", 0, "", {})


def test_a_step_costs_little(tmp_path: Path) -> None:
    """Loose bound: about 0.9 ms measured; ten times that would be felt in a run of 250 steps."""
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(10))
        start = time.process_time()
        write_steps(run, range(10, 60))
        assert (time.process_time() - start) / 50 < 0.01
