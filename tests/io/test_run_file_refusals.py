"""run.h5: what cannot be written or read is refused, by name, and leaves what was there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import RunFile, place
from mlsanm_cli.io.run_reader import read_run
from tests.io.run_files import M, contact_values, datasets, start_run, step_row, write_fields, write_steps


def test_a_row_of_another_shape_is_refused(tmp_path: Path) -> None:
    run = start_run(tmp_path / "run.h5")
    write_steps(run, range(1))
    run.save()
    run.add([step_row(1, contacts={"interface": contact_values(1) | {"gap": np.ones(M + 1)}})])
    with pytest.raises(ValueError, match=r"contacts/interface/gap: shape \(8,\), expected \(7,\)"):
        run.save()
    assert {len(array) for name, array in datasets(tmp_path / "run.h5").items() if "path/" in name} == {1}


@pytest.mark.parametrize("name", ["", ".", "..", "a/b"])
def test_names_that_hdf5_would_take_for_paths_are_refused(name: str) -> None:
    with pytest.raises(RunError, match="cannot be stored"):
        place("bodies", name, "points")


def test_create_never_overwrites_and_reports_a_missing_directory(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_text("mine")
    with pytest.raises(RunError, match="exists already"):
        RunFile.create(path, {})
    assert path.read_text() == "mine"
    with pytest.raises(RunError, match="cannot write"):
        RunFile.create(tmp_path / "none" / "run.h5", {}).save()


ROOT = Path(__file__).parents[2]


def test_reader_names_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no such directory"):
        read_run(tmp_path / "none")
    with pytest.raises(RunError, match=r"holds no run\.h5"):
        read_run(tmp_path)
    path = tmp_path / "run.h5"
    path.write_bytes(b"not hdf5 at all")
    with pytest.raises(RunError, match="it is damaged"):
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


def test_a_damaged_file_is_refused_by_name_or_read(tmp_path: Path) -> None:
    """In a process of its own, which HDF5 must not bring down."""
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(20))
        write_fields(run, 0, 0.5, {"upper/von_mises": np.arange(5.0)})
    output = subprocess.run(
        [sys.executable, "-c", DAMAGED, str(tmp_path / "run.h5")],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert output.returncode == 0, output.stderr
    refused, whole = map(int, output.stdout.split())
    assert refused > 50
    assert whole > 10


DAMAGED = """
import random, sys
from pathlib import Path
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.run_reader import read_origin, read_run
path, draw, refused = Path(sys.argv[1]), random.Random(0), 0
content = path.read_bytes()
for trial in range(300):
    damaged = bytearray(content)
    for _ in range(draw.choice((1, 20, 300))):
        damaged[draw.randrange(len(damaged) if trial % 2 else 2000)] = draw.randrange(256)
    path.write_bytes(damaged[: draw.choice((len(damaged), draw.randrange(len(damaged))))])
    try:
        read_run(path), read_origin(path), RunFile.reopen(path, {}).close()
    except RunError as error:
        assert str(path) in str(error), error
        refused += 1
print(refused, 300 - refused)
"""
