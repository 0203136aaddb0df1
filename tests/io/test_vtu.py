"""VTU and PVD files, read back with meshio and an XML parser."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from mlsanm_cli.io.vtu import StateWriter, VtuPart, write_parts

RNG = np.random.default_rng(3)


NONE = np.zeros((0, 3), dtype=np.int64)


def part(count: int, cells: np.ndarray = NONE, **changes: Any) -> VtuPart:
    data: dict[str, Any] = {
        "boundary_tag": np.arange(count, dtype=np.int32) % 3,
        "displacement": RNG.random((count, 2)),
        "stress": RNG.random((count, 4)),
        "von_mises": RNG.random(count),
    }
    return VtuPart(RNG.random((count, 2)), cells, data | changes)


def read(path: Path) -> meshio.Mesh:
    return meshio.read(path, file_format="vtu")


def test_every_array_reads_back_bit_for_bit_in_three_dimensions(tmp_path: Path) -> None:
    body = part(11, strain=RNG.random((11, 3)))
    StateWriter(tmp_path).write(1.0, {"block": body}, {}, {})
    mesh = read(tmp_path / "fields_0000.vtu")
    zero = np.zeros(11)
    np.testing.assert_array_equal(mesh.points, np.column_stack([body.points, zero]))
    assert [(cells.type, cells.data.tolist()) for cells in mesh.cells] == [
        ("vertex", [[node] for node in range(11)])
    ]
    data = mesh.point_data
    assert set(data) == {"boundary_tag", "displacement", "stress", "von_mises", "strain"}
    np.testing.assert_array_equal(data["displacement"], np.column_stack([body.data["displacement"], zero]))
    for name in ("stress", "strain"):
        xx, yy, xy, zz = [*body.data[name].T, zero][:4]
        rows = np.array([[xx, xy, zero], [xy, yy, zero], [zero, zero, zz]])
        np.testing.assert_array_equal(data[name], rows.transpose(2, 0, 1).reshape(11, 9))
    np.testing.assert_array_equal(data["von_mises"], body.data["von_mises"])
    np.testing.assert_array_equal(data["boundary_tag"], body.data["boundary_tag"])
    assert data["boundary_tag"].dtype.kind == "i"


def test_arrays_of_the_other_byte_order_read_back_too(tmp_path: Path) -> None:
    data = {"a": np.array([1.0, 2.0], dtype=">f8"), "b": np.array([3, 4], dtype="<i4")}
    write_parts(tmp_path / "a.vtu", "", [VtuPart(np.zeros((2, 2), dtype=">f8"), NONE, data)])
    found = read(tmp_path / "a.vtu").point_data
    assert {name: array.tolist() for name, array in found.items()} == {"a": [1.0, 2.0], "b": [3, 4]}


def test_collection_lists_every_state_and_body_after_each_state(tmp_path: Path) -> None:
    writer = StateWriter(tmp_path)
    expected = []
    for k, position in enumerate((0.1, 1 / 3, 2.0)):
        writer.write(position, {'upper <&">': part(3), "block": part(2)}, {}, {})
        for number, name in enumerate(('upper <&">', "block")):
            expected.append((position, number, name, f"fields_{2 * k + number:04d}.vtu"))
        root = ET.parse(tmp_path / "fields.pvd").getroot()
        assert (root.tag, root.get("type")) == ("VTKFile", "Collection")
        sets = root.findall("Collection/DataSet")
        listed = [
            (float(s.attrib["timestep"]), int(s.attrib["part"]), s.get("name"), s.get("file")) for s in sets
        ]
        assert listed == expected
    assert all((tmp_path / entry[3]).is_file() for entry in expected)
    assert not list(tmp_path.glob("*.tmp"))


def test_one_file_joins_bodies_and_keeps_shared_data(tmp_path: Path) -> None:
    first, second = part(3, normal=RNG.random((3, 2))), part(5)
    write_parts(tmp_path / "failure.vtu", "body", [first, second])
    mesh = read(tmp_path / "failure.vtu")
    assert mesh.point_data["body"].tolist() == [0] * 3 + [1] * 5
    np.testing.assert_array_equal(mesh.points[3:, :2], second.points)
    assert set(mesh.point_data) == {"body", *second.data}


def test_triangles_fill_a_body_and_points_in_none_stay_vertices(tmp_path: Path) -> None:
    triangles = np.array([[0, 1, 2], [1, 3, 2]])
    write_parts(tmp_path / "a.vtu", "body", [part(5, triangles), part(4, triangles)])
    found = {cells.type: cells.data.tolist() for cells in read(tmp_path / "a.vtu").cells}
    assert found == {"triangle": [[0, 1, 2], [1, 3, 2], [5, 6, 7], [6, 8, 7]], "vertex": [[4]]}
