"""run.h5: layout, equality of equal runs, reading while it is written, and what a kill leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.io.run_file import ContactRecord, RunFile, StepRecord
from mlsanm_cli.io.run_reader import read_run
from tests.io.run_files import (
    LOADS,
    RESULTANTS,
    M,
    contact_record,
    datasets,
    start_run,
    write_steps,
)

ROOT = Path(__file__).parents[2]


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
from pathlib import Path
from tests.io.run_files import start_run, write_steps
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
                KILLED,
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
    columns["position"].write(3, columns["position"].solve_with_error(9.0))
    columns["contacts/interface/gap"].write(3, columns["contacts/interface/gap"].solve_with_error(np.ones(M)))
    run._file.flush()
    data = read_run(tmp_path)
    assert data.path.rows == 3
    assert data.contacts["interface"].gap.shape == data.contacts["interface"].slip.shape == (3, M)
    run.close()
    run.close()
    assert datasets(tmp_path / "run.h5")["path/position"].tolist() == [0.0, 0.125, 0.25]


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
