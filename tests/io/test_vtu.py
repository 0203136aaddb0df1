"""VTU and PVD files, read back with meshio and an XML parser."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.vtk_xml import vertices, write_grid
from mlsanm_cli.io.vtu import BodyState, ModelBody, StateWriter, write_model, write_single

RNG = np.random.default_rng(3)


def state(count: int, **changes: Any) -> BodyState:
    fields: dict[str, Any] = {
        "points": RNG.random((count, 2)),
        "boundary_tag": np.arange(count) % 3,
        "displacement": RNG.random((count, 2)),
        "stress": RNG.random((count, 3)),
        "von_mises": RNG.random(count),
        "stress_zz": RNG.random(count),
    }
    return BodyState(**(fields | changes))


def read(path: Path) -> meshio.Mesh:
    return meshio.read(path, file_format="vtu")


def test_every_array_reads_back_bit_for_bit_in_three_dimensions(tmp_path: Path) -> None:
    body = state(11)
    (path,) = StateWriter(tmp_path).write(1.0, {"block": body})
    mesh = read(path)
    np.testing.assert_array_equal(mesh.points, np.column_stack([body.points, np.zeros(11)]))
    assert [(cells.type, cells.data.tolist()) for cells in mesh.cells] == [
        ("vertex", [[node] for node in range(11)])
    ]
    data = mesh.point_data
    assert set(data) == {"boundary_tag", "displacement", "stress", "von_mises"}
    assert body.displacement is not None
    assert body.stress is not None
    assert body.stress_zz is not None
    np.testing.assert_array_equal(data["displacement"], np.column_stack([body.displacement, np.zeros(11)]))
    xx, yy, xy = body.stress.T
    zero = np.zeros(11)
    rows = np.array([[xx, xy, zero], [xy, yy, zero], [zero, zero, body.stress_zz]])
    np.testing.assert_array_equal(data["stress"], rows.transpose(2, 0, 1).reshape(11, 9))
    np.testing.assert_array_equal(data["von_mises"], body.von_mises)
    np.testing.assert_array_equal(data["boundary_tag"], body.boundary_tag)
    assert data["boundary_tag"].dtype.kind == "i"


def test_arrays_of_the_other_byte_order_read_back_too(tmp_path: Path) -> None:
    data = {"a": np.array([1.0, 2.0], dtype=">f8"), "b": np.array([3, 4], dtype="<i4")}
    write_grid(tmp_path / "a.vtu", np.zeros((2, 3), dtype=">f8"), [vertices(2)], data)
    found = read(tmp_path / "a.vtu").point_data
    assert {name: array.tolist() for name, array in found.items()} == {"a": [1.0, 2.0], "b": [3, 4]}


def test_fields_left_out_are_left_out_and_zz_defaults_to_zero(tmp_path: Path) -> None:
    writer = StateWriter(tmp_path)
    (path,) = writer.write(0.0, {"a": state(4, displacement=None, von_mises=None, stress_zz=None)})
    data = read(path).point_data
    assert set(data) == {"boundary_tag", "stress"}
    assert data["stress"][:, 8].tolist() == [0.0] * 4
    (path,) = writer.write(0.0, {"a": state(4, stress=None)})
    assert set(read(path).point_data) == {"boundary_tag", "displacement", "von_mises"}


def test_collection_lists_every_state_and_body_after_each_state(tmp_path: Path) -> None:
    writer = StateWriter(tmp_path)
    expected = []
    for k, position in enumerate((0.1, 1 / 3, 2.0)):
        paths = writer.write(position, {'upper <&">': state(3), "block": state(2)})
        assert [path.name for path in paths] == [f"fields_{2 * k:04d}.vtu", f"fields_{2 * k + 1:04d}.vtu"]
        for part, name in enumerate(('upper <&">', "block")):
            expected.append((position, part, name, paths[part].name))
        root = ET.parse(tmp_path / "fields.pvd").getroot()
        assert (root.tag, root.get("type")) == ("VTKFile", "Collection")
        sets = root.findall("Collection/DataSet")
        listed = [
            (float(s.attrib["timestep"]), int(s.attrib["part"]), s.get("name"), s.get("file")) for s in sets
        ]
        assert listed == expected
    assert all((tmp_path / entry[3]).is_file() for entry in expected)
    assert not list(tmp_path.glob("*.tmp"))


def test_single_file_joins_bodies_and_keeps_shared_fields(tmp_path: Path) -> None:
    first, second = state(3), state(5, von_mises=None)
    write_single(tmp_path / "failure.vtu", {"a": first, "b": second})
    mesh = read(tmp_path / "failure.vtu")
    assert mesh.point_data["body"].tolist() == [0] * 3 + [1] * 5
    np.testing.assert_array_equal(mesh.points[3:, :2], second.points)
    assert set(mesh.point_data) == {"body", "boundary_tag", "displacement", "stress"}
    with pytest.raises(ValueError, match="no body"):
        write_single(tmp_path / "empty.vtu", {})


def test_model_shows_spacing_normals_and_partners(tmp_path: Path) -> None:
    bodies = {
        name: ModelBody(
            RNG.random((n, 2)), np.arange(n), RNG.random(n), RNG.random((n, 2)), RNG.random((n, 2))
        )
        for name, n in (("a", 4), ("b", 6))
    }
    write_model(tmp_path / "model.vtu", bodies)
    mesh = read(tmp_path / "model.vtu")
    assert mesh.point_data["body"].tolist() == [0] * 4 + [1] * 6
    for key in ("normal", "partner"):
        joined = np.concatenate([getattr(body, key) for body in bodies.values()])
        np.testing.assert_array_equal(mesh.point_data[key], np.column_stack([joined, np.zeros(10)]))
    spacing = np.concatenate([body.spacing for body in bodies.values()])
    np.testing.assert_array_equal(mesh.point_data["spacing"], spacing)
    assert mesh.point_data["boundary_tag"].tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("field", "shape"),
    [
        ("points", (4, 3)),
        ("boundary_tag", (3,)),
        ("displacement", (4, 3)),
        ("stress", (4, 4)),
        ("stress_zz", (5,)),
        ("von_mises", (4, 1)),
    ],
)
def test_wrong_shapes_are_refused(tmp_path: Path, field: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=f"{field}: shape"):
        StateWriter(tmp_path).write(0.0, {"a": state(4, **{field: np.zeros(shape)})})
    assert list(tmp_path.iterdir()) == []


def test_a_missing_directory_is_a_run_error(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="cannot write"):
        StateWriter(tmp_path / "none").write(0.0, {"a": state(2)})


def test_triangles_fill_a_body_and_points_in_none_stay_vertices(tmp_path: Path) -> None:
    triangles = np.array([[0, 1, 2], [1, 3, 2]])
    write_single(tmp_path / "a.vtu", {"a": state(5, triangles=triangles), "b": state(4, triangles=triangles)})
    found = {cells.type: cells.data.tolist() for cells in read(tmp_path / "a.vtu").cells}
    assert found == {"triangle": [[0, 1, 2], [1, 3, 2], [5, 6, 7], [6, 8, 7]], "vertex": [[4]]}
