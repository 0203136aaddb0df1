"""run.h5: layout, equality of equal runs, reading while it is written, going on with it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_file
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.io.schema import row
from tests.processes import printed

M = 7  # slave nodes of the contact
LOADS = ["squeeze", "press"]
RESULTANTS = ["press", "block.bottom"]


def contact_values(step: int) -> dict[str, Any]:
    base, status = np.linspace(0.0, 1.0, M) + step, np.array([0, 1, 2, 0, 1, 2, step % 3], dtype=np.int8)
    values = {name: base + k / 4 for k, name in enumerate(("pressure", "traction", "gap", "slip"))}
    return {**values, "status": status, "dissipated_work": 0.0}


def step_row(step: int, seconds: float = 0.5, contacts: dict[str, dict[str, Any]] | None = None) -> Any:
    path = {"position": step / 8, "step_length": 0.125, "residual": 1e-9 * step, "order": 20}
    path |= {"factorizations": step, "solves": 20 * step, "seconds": seconds}
    return row(
        path,
        {
            "factors": {"squeeze": 1.0, "press": step / 8},
            "resultants": {"press": np.array([0.0, -step]), "block.bottom": np.array([0.5, step])},
            "contacts": {"interface": contact_values(step)} if contacts is None else contacts,
        },
    )


def start_run(path: Path) -> RunFile:
    run = RunFile.create(path, {"argv": "mlsanm run a.toml", "threads": 1, "wall_limit": 2.5})
    points, line = np.arange(10.0).reshape(5, 2), np.linspace(-1.0, 1.0, M)
    run.confirm({"case/raw": 'title = "é"\n', "case/resolved": "format = 1\n"})
    for name, index, normal, names in (
        ("upper", [0, 3], [[0.0, 1.0], [1.0, 0.0]], ["arc", "flat"]),
        ("block", [4], [[0.0, -1.0]], ["bottom"]),
    ):
        boundary = f"bodies/{name}/boundary"
        run.confirm({f"bodies/{name}/points": points, f"{boundary}/index": np.array(index)})
        run.confirm({f"{boundary}/normal": np.array(normal), f"{boundary}/name": names})
    geometry = {
        "points": np.column_stack([line, line**2]),
        "normal": np.tile([0.0, 1.0], (M, 1)),
        "arc_length": line + 1,
        "weight": np.full(M, 1 / 3),
    }
    run.confirm({f"contacts/interface/{key}": array for key, array in geometry.items()})
    return run


def write_steps(run: RunFile, steps: range, seconds: float = 0.5) -> None:
    for step in steps:
        series = {f"series/{step}/pressure": np.full((21, M), float(step))}
        numbers = {f"series/{step}": {"length": 0.125, "start": step / 8}}
        run.add([step_row(step, seconds)], series, numbers)


def write_fields(run: RunFile, number: int, position: float, fields: dict[str, Any]) -> None:
    datasets = {f"fields/{number}/{name}": array for name, array in fields.items()}
    run.add([{"fields/position": position}], datasets)


def datasets(path: Path) -> dict[str, np.ndarray]:
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None
        )
    return found


def test_reader_gives_back_what_was_written_in_the_order_of_the_case(tmp_path: Path) -> None:
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(5))
        write_fields(run, 0, 0.5, {"upper/von_mises": np.arange(5.0), "block/von_mises": np.ones(5)})
        run.set_status("done")
    with h5py.File(tmp_path / "run.h5", "r") as file:
        attributes = {"format": 1, "mlsanm_version": __version__, "status": "done", "threads": 1}
        assert dict(file.attrs) == {**attributes, "wall_limit": 2.5, "argv": "mlsanm run a.toml"}
        assert dict(file["series/3"].attrs) == {"length": 0.125, "start": 0.375}
    data = read_run(tmp_path)
    assert data.status == "done"
    assert data.directory == tmp_path
    assert (data.case_raw, data.case_resolved) == ('title = "é"\n', "format = 1\n")
    assert list(data.bodies) == ["upper", "block"]
    assert data.bodies["upper"].boundary.name == ["arc", "flat"]
    assert list(data.path.factors) == LOADS
    assert list(data.path.resultants) == RESULTANTS
    np.testing.assert_array_equal(data.path.position, np.arange(5) / 8)
    np.testing.assert_array_equal(data.path.resultants["block.bottom"][:, 1], np.arange(5))
    contact = data.contacts["interface"]
    for step in range(5):
        expected = contact_values(step)
        for key in ("pressure", "traction", "gap", "slip", "status"):
            np.testing.assert_array_equal(getattr(contact, key)[step], expected[key])
    assert [state.position for state in data.states] == [0.5]
    assert list(data.states[0].bodies) == ["upper", "block"]
    np.testing.assert_array_equal(data.states[0].bodies["upper"]["von_mises"], np.arange(5.0))


def test_a_run_without_contacts_loads_or_candidates_can_be_stored(tmp_path: Path) -> None:
    with RunFile.create(tmp_path / "run.h5", {}) as run:
        empty = np.empty(0)
        run.confirm({f"contacts/far/{name}": np.empty((0, 2)) for name in ("points", "normal")})
        run.confirm({f"contacts/far/{name}": empty for name in ("arc_length", "weight")})
        nothing = {**dict.fromkeys(contact_values(0), empty), "dissipated_work": 0.0}
        nothing["status"] = np.empty(0, np.int8)
        for _ in range(2):
            run.add([step_row(0, contacts={"far": nothing})])
    data = read_run(tmp_path)
    assert data.rows == 2
    assert data.contacts["far"].pressure.shape == (2, 0)
    assert data.states == ()


def test_other_programs_read_what_is_saved_while_the_run_goes_on(tmp_path: Path) -> None:
    code = """import sys, h5py
with h5py.File(sys.argv[1], "r") as f:
    last = f["contacts/interface/pressure"][-1, 0]
    print(f.attrs["status"], len(f["path/position"]), last, len(f["series"]))
"""
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(3))
        run.save()
        write_steps(run, range(3, 5))
        assert printed("-c", code, str(tmp_path / "run.h5")).split() == ["running", "3", "2.0", "3"]
        assert read_run(tmp_path).rows == 3
    assert read_run(tmp_path).rows == 5


def test_an_exception_saves_what_was_added(tmp_path: Path) -> None:
    def fail() -> None:
        with start_run(tmp_path / "run.h5") as run:
            write_steps(run, range(2))
            run.set_status("failed")
            write_steps(run, range(2, 3))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    data = read_run(tmp_path)
    assert (data.status, data.rows) == ("failed", 3)


def test_a_signal_amid_saving_repeats_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls, put = list[str](), run_file._put

    def interrupted(file: h5py.File, name: str, value: run_file.Value) -> None:
        put(file, name, value)
        calls.append(name)
        if len(calls) == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(run_file, "_put", interrupted)
    run = start_run(tmp_path / "run.h5")
    write_steps(run, range(4))
    with pytest.raises(KeyboardInterrupt):
        run.save()
    write_steps(run, range(4, 6))
    assert len(run.path_table()["position"]) == 6
    run.close()
    run.close()
    data = read_run(tmp_path)
    np.testing.assert_array_equal(data.path.position, np.arange(6) / 8)
    np.testing.assert_array_equal(data.contacts["interface"].slip[:, 0], np.arange(6) + 0.75)


def test_a_file_goes_on_where_it_was_left(tmp_path: Path) -> None:
    for name, cuts in (("whole", (0, 6)), ("cut", (0, 2, 3, 6))):
        (tmp_path / name).mkdir()
        for first, last in itertools.pairwise(cuts):
            file = tmp_path / name / "run.h5"
            with start_run(file) if first == 0 else RunFile.reopen(file, {"resumed": first}) as run:
                write_steps(run, range(first, last), seconds=0.5)
                write_fields(run, len(run.saved_positions()), last / 8, {"upper/von_mises": np.ones(5)})
    whole, cut = (datasets(tmp_path / name / "run.h5") for name in ("whole", "cut"))
    assert cut.pop("fields/position").tolist() == [0.25, 0.375, 0.75]
    assert whole.pop("fields/position").tolist() == [0.75]
    assert whole.keys() == {name for name in cut if name[:8] not in ("fields/1", "fields/2")}
    assert all(whole[name].tolist() == cut[name].tolist() for name in whole)
    resumed = read_run(tmp_path / "cut")
    assert (resumed.attributes["resumed"], resumed.status) == (3, "running")


def test_a_file_takes_nearly_the_same_model_only(tmp_path: Path) -> None:
    start_run(tmp_path / "run.h5").close()
    weight = np.full(M, 1 / 3)
    with RunFile.reopen(tmp_path / "run.h5", {}) as run:
        run.confirm({"contacts/interface/weight": np.nextafter(weight, 1.0), "maps/new": weight})
        for name, value in (
            ("contacts/interface/weight", weight * 1.001),
            ("contacts/interface/weight", weight[1:]),
            ("case/raw", "other"),
            ("bodies/upper/boundary/name", ["arc", "top"]),
        ):
            with pytest.raises(RunError, match=f"/{name} is not reproduced"):
                run.confirm({name: value})
    assert "maps/new" in datasets(tmp_path / "run.h5")


def test_a_run_killed_before_its_path_began_reads_as_empty(tmp_path: Path) -> None:
    RunFile.create(tmp_path / "run.h5", {}).close()
    data = read_run(tmp_path)
    assert (data.status, data.rows, data.case_raw, dict(data.bodies)) == ("running", 0, "", {})
    start_run(tmp_path / "other.h5").close()
    assert read_run(tmp_path / "other.h5").contacts["interface"].pressure.shape == (0, M)


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


def test_a_damaged_file_is_refused_by_name(tmp_path: Path) -> None:
    """In a process of its own, which HDF5 must not bring down."""
    with start_run(tmp_path / "run.h5") as run:
        write_steps(run, range(20))
        write_fields(run, 0, 0.5, {"upper/von_mises": np.arange(5.0)})
    assert printed("-c", DAMAGED, str(tmp_path / "run.h5")) == "300"


DAMAGED = """
import random, sys
from pathlib import Path
from typing import Any
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
print(refused, end="")
"""
