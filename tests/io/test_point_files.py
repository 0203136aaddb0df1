"""Clouds in CSV and HDF5 files."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.errors import GeometryError
from mlsanm_cli.io import self_contained
from mlsanm_cli.io.meshes import read_points

TABLE = """x, y, tag, nx, ny
0.0, 0.0, floor, 0.0, -1.0

1.0, 0.0, floor, ,
0.5, 0.5, , ,
"""


def test_a_table_is_read_with_the_places_of_its_lines(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\ufeff" + TABLE, encoding="utf-8")
    points, tags, normals, places = read_points(tmp_path / "a.csv")
    assert points.tolist() == [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]]
    assert tags == ("floor", "floor", "")
    assert normals[0].tolist() == [0.0, -1.0]
    assert np.isnan(normals[1:]).all()
    assert places == ("line 2", "line 4", "line 5")


def test_hdf5_holds_the_columns_as_datasets(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"], file["y"] = np.array([0.0, 1.0]), np.array([0.1, 1.1])
        file["tag"] = np.array([b"rim", b""])
    points, tags, normals, _ = read_points(tmp_path / "a.h5")
    assert points.tolist() == [[0.0, 0.1], [1.0, 1.1]]
    assert tags == ("rim", "")
    assert np.isnan(normals).all()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("x, y, tag", "x, y, name", 'line 1: unknown column "name"'),
        ("x, y, tag, nx, ny", "x, y, x, nx, ny", "line 1: the column .x. appears twice"),
        (", nx, ny", ", nx", "line 1: nx and ny are needed together"),
        ("1.0, 0.0, floor, ,", "1.0, zero, floor, ,", "line 4: y is not a number: 'zero'"),
        ("1.0, 0.0, floor, ,", "1.0, nan, floor, ,", "line 4: the node has no coordinates"),
        ("1.0, 0.0, floor, ,", "1.0, 0.0, floor", "line 4: 3 values for 5 columns"),
        ("1.0, 0.0, floor, ,", "1.0, 0.0, the floor, ,", "line 4: the tag .the floor. is not a valid name"),
        ("0.0, -1.0\n", "0.0, -2.0\n", "line 2: the normal has length 2, not 1"),
        ("0.0, -1.0\n", "0.0,\n", "line 2: a normal needs both"),
        (TABLE[TABLE.index("0.0") :], "", "there are no nodes"),
    ],
)
def test_wrong_tables_are_refused_with_their_line(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in TABLE
    (tmp_path / "a.csv").write_text(TABLE.replace(old, new))
    with pytest.raises(GeometryError, match=words):
        read_points(tmp_path / "a.csv")


def test_files_that_are_no_cloud_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_text("no HDF5")
    (tmp_path / "b.csv").write_bytes(b"x,y,tag\n\xff")
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["x"], file["y"], file["tag"] = np.zeros(2), np.zeros(3), np.array([b"", b""])
    for name, words in (("a.h5", "not an HDF5 file"), ("b.csv", "not UTF-8"), ("c.h5", "x 2, y 3, tag 2")):
        with pytest.raises(GeometryError, match=words):
            read_points(tmp_path / name)


def test_files_made_to_mislead_are_refused(tmp_path: Path) -> None:
    (tmp_path / "wide.csv").write_text(f"x,y,tag\n0,0,{'a' * 140_000}\n")
    (tmp_path / "head.csv").write_text(f"x,y,{'t' * 140_000}\n")

    def hdf5(name: str, **columns: object) -> None:
        with h5py.File(tmp_path / name, "w") as file:
            file["x"], file["y"], file["tag"] = np.zeros(1), np.zeros(1), np.array([b""])
            for column, value in columns.items():
                del file[column]
                file[column] = value

    hdf5("loop.h5", x=h5py.SoftLink("/x"))
    hdf5("out.h5", x=h5py.ExternalLink("other.h5", "x"))
    hdf5("null.h5", x=h5py.Empty("f8"))
    hdf5("text.h5", tag=np.array([b"\xff"]))
    with h5py.File(tmp_path / "raw.h5", "w") as file:
        file["y"], file["tag"] = np.zeros(1), np.array([b""])
        file.create_dataset("x", (1,), "f8", external=[("/etc/passwd", 0, 8)])
    with h5py.File(tmp_path / "round.h5", "w") as file:
        file["x"], file["y"], file["tag"] = np.zeros(1), np.zeros(1), np.array([b""])
        file["group"] = file["/"]
    for name, words in {
        "wide.csv": "line 2: field larger than",
        "head.csv": "line 1: field larger than",
        "loop.h5": "/x is a link",
        "out.h5": "/x is a link",
        "null.h5": "the dataset x has no data",
        "text.h5": "not UTF-8",
        "raw.h5": "the data of /x are in another file",
        "round.h5": "/group appears twice",
    }.items():
        with pytest.raises(GeometryError, match=words):
            read_points(tmp_path / name)


@pytest.mark.parametrize("reader", ["while True: pass", "import os; os.abort()"])
def test_a_file_that_the_library_does_not_read_to_an_end_is_refused(
    reader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"], file["y"], file["tag"] = np.zeros(1), np.zeros(1), np.array([b""])
    monkeypatch.setattr(self_contained, "READER", reader)
    monkeypatch.setattr(self_contained, "MAX_SECONDS", 1.0)
    with pytest.raises(GeometryError, match="damaged"):
        read_points(tmp_path / "a.h5")
