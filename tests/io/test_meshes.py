"""Meshes of other programs: what is read of them, and what is refused.

``tests/data`` holds plates with a hole, of Gmsh 4.15: triangles in version 2.2 of its format and in Abaqus's,
quads with mid-side nodes in version 4.1.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from mlsanm_cli.errors import GeometryError
from mlsanm_cli.io import self_contained
from mlsanm_cli.io.meshes import MeshFile, read_mesh

DATA = Path(__file__).parents[1] / "data"
GROUPS = {"bottom", "right", "top", "left", "hole"}
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]])
TWO = [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])]


def write(path: Path, points: np.ndarray = SQUARE, cells: object = TWO, **data: object) -> Path:
    meshio.Mesh(points, cells, **data).write(path)
    return path


def places(mesh: MeshFile, name: str) -> np.ndarray:
    chosen = np.array([other == name for other in mesh.names])
    found: np.ndarray = mesh.points[np.unique(mesh.lines[chosen])]
    return found


@pytest.mark.parametrize(
    ("file", "nodes", "around", "hole"),
    [("plate22.msh", 72, 3, 12), ("plate.inp", 72, 3, 12), ("plate41.msh", 336, 8, 32)],
)
def test_gmsh_and_abaqus_files_with_groups(file: str, nodes: int, around: int, hole: int) -> None:
    mesh = read_mesh(DATA / file)
    assert {ring.shape[1] for ring in mesh.rings} >= {around}
    assert set(mesh.names) == GROUPS
    assert np.hypot(*places(mesh, "hole").T) == pytest.approx(np.ones(hole))
    assert (places(mesh, "left")[:, 0] == -5.0).all()
    assert abs(len(mesh.points) - nodes) < 0.2 * nodes


def test_a_vtu_file_names_boundaries_by_its_only_integers(tmp_path: Path) -> None:
    cells = [*TWO, ("line", [[0, 1], [1, 4]])]
    tags = [np.array([0]), np.array([0]), np.array([7, 8])]
    mesh = read_mesh(write(tmp_path / "a.vtu", cells=cells, cell_data={"side": tags}))
    assert mesh.names == ("side7", "side8")
    path = write(tmp_path / "b.vtu", cells=cells, cell_data={"side": tags, "part": tags})
    with pytest.raises(GeometryError, match="several cell data could name the boundaries: side, part"):
        read_mesh(path)


def test_sets_of_nodes_and_unnamed_lists_of_an_abaqus_file(tmp_path: Path) -> None:
    text = "*NODE\n" + "".join(f"{k + 1}, {x}, {y}\n" for k, (x, y, _) in enumerate(SQUARE))
    text += "*ELEMENT, TYPE=CPS4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=CPS3, ELSET=tip\n2, 2, 5, 3\n"
    (tmp_path / "a.inp").write_text(text + "*NSET, NSET=foot plate\n1, 2, 5\n")
    mesh = read_mesh(tmp_path / "a.inp")
    assert {name: sorted(nodes) for name, nodes in mesh.node_sets.items()} == {"foot_plate": [0, 1, 4]}
    assert len(read_mesh(tmp_path / "a.inp", "tip").points) == 3


@pytest.mark.parametrize("kind", ["CPE4", "CPE4R", "CPS8R", "CPEG8"])
def test_plane_elements_of_abaqus_are_read(tmp_path: Path, kind: str) -> None:
    places = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]])
    count = 8 if "8" in kind else 4
    text = "*Node\n" + "".join(f"{k + 1}, {x}, {y}\n" for k, (x, y) in enumerate(places[:count]))
    text += f"*Element, type={kind}\n1, " + ", ".join(str(k + 1) for k in range(count)) + "\n"
    (tmp_path / "a.inp").write_text(text)
    (ring,) = read_mesh(tmp_path / "a.inp").rings
    around = places[ring[0]]
    assert np.hypot(*np.diff(np.vstack([around, around[:1]]), axis=0).T).sum() == pytest.approx(4.0)


def test_one_group_of_elements_is_a_body(tmp_path: Path) -> None:
    tags = [np.array([1]), np.array([2]), np.array([5])]
    cells = [*TWO, ("line", [[1, 4]])]
    path = tmp_path / "a.msh"
    meshio.Mesh(
        SQUARE,
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"block": np.array([1, 2]), "wedge": np.array([2, 2]), "foot": np.array([5, 1])},
    ).write(path, file_format="gmsh22", binary=False)
    whole, wedge, block = read_mesh(path), read_mesh(path, "wedge"), read_mesh(path, "block")
    assert [len(mesh.points) for mesh in (whole, wedge, block)] == [5, 3, 4]
    assert wedge.names == ("foot",)
    assert block.names == ()
    with pytest.raises(GeometryError, match='no group of elements "wedg"') as error:
        read_mesh(path, "wedg")
    assert error.value.hint == "groups: block, wedge"


def test_nodes_of_no_element_are_left_out_and_any_plane_will_do(tmp_path: Path) -> None:
    points = np.vstack([np.full(3, 9.0), SQUARE + np.array([0.0, 0.0, 9.0])])
    cells = [("quad", [[1, 2, 3, 4]]), ("triangle", [[2, 5, 3]])]
    mesh = read_mesh(write(tmp_path / "a.vtu", points, cells))
    assert mesh.points == pytest.approx(SQUARE[:, :2])
    assert [ring.tolist() for ring in mesh.rings] == [[[0, 1, 2, 3]], [[1, 4, 2]]]


@pytest.mark.parametrize(
    ("points", "cells", "words"),
    [
        (SQUARE, [("tetra", [[0, 1, 2, 3]])], 'type "tetra"'),
        (SQUARE + np.arange(5.0)[:, None] * [0, 0, 1], TWO, "z varies by 4"),
        (SQUARE, [("line", [[0, 1]])], "no triangles or quads"),
        (SQUARE, [("triangle", [[0, 1, 7]])], "refers to a node that is not in the file"),
        (SQUARE * [1.0, np.nan, 1.0], TWO, "the coordinates of node 1 are not finite"),
    ],
)
def test_what_is_no_plane_mesh_is_refused(
    points: np.ndarray, cells: object, words: str, tmp_path: Path
) -> None:
    with pytest.raises(GeometryError, match=words):
        read_mesh(write(tmp_path / "a.vtu", points, cells))


def test_broken_files_are_refused_in_one_sentence(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text = (DATA / "plate22.msh").read_text()
    for name, content in {
        "cut.msh": text[: len(text) // 2],
        "empty.msh": "",
        "noise.msh": "no mesh at all\n",
        "cut.inp": (DATA / "plate.inp").read_text()[:3000],
        "noise.vtu": "<VTKFile>",
        "unknown.xyz": text,
    }.items():
        (tmp_path / name).write_text(content)
        with pytest.raises(GeometryError) as error:
            read_mesh(tmp_path / name)
        assert error.value.message
    assert capfd.readouterr() == ("", "")


NODES = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n"
FACE = "*ELEMENT, TYPE=CPS4, ELSET=all\n7, 1, 2, 3, 4\n"
FOOT = "*NSET, NSET=foot\n1, 2\n"
PART = f"*Part, name=P\n{NODES}{FACE}{FOOT}*End Part\n"
TURNED = "*Instance, name=A, part=p\n2, 0, 0\n2, 0, 0, 2, 0, 1, 90.\n*End Instance\n"
PLACED = PART.replace(FOOT, "") + TURNED


@pytest.mark.parametrize(
    ("text", "group", "foot"),
    [
        (f"{PART}*Instance, name=A, part=P\n2., 3.\n*End Instance\n", None, [[2, 3], [3, 3]]),
        (PART + TURNED, "A", [[2, 0], [2, 1]]),
        (f"{PART}*Instance, name=B, part=P\n*End Instance\n{TURNED}", "B", [[0, 0], [1, 0]]),
        (PART + PART.replace("=P", "=Q").replace("1, 0", "1, -1"), "P", [[0, 0], [1, 0]]),
        (f"{PLACED}*NODE\n1, 9, 9, 9\n*NSET, NSET=foot, INSTANCE=a\n1, 4\n", "A", [[2, 0], [1, 0]]),
        (f"{PLACED}*NSET, NSET=foot\nA.1, A.4\n", "A", [[2, 0], [1, 0]]),
        ("*NODE\n3, 1, 1\n4, , 1\n*node, nset=foot\n1, 0\n2, 1.D0\n** end\n" + FACE, "all", [[0, 0], [1, 0]]),
        (f"{NODES}{FACE}*NSET,\nNSET=foot,\nGENERATE\n1, 2\n", None, [[0, 0], [1, 0]]),
        (f"{NODES}{FACE}*NSET, NSET=foot\n1, 2, 77\n", None, [[0, 0], [1, 0]]),
        (f"{NODES}{FACE}{FOOT}*ELSET, ELSET=part\n7, 8\n", "part", [[0, 0], [1, 0]]),
        (f"{NODES}5, 0.5, 0\n{FACE}*ELEMENT, TYPE=B21, ELSET=foot\n8, 2, 1\n", None, [[0, 0], [1, 0]]),
        (f"{NODES}{FACE}*SURFACE, NAME=foot\nall, S1\n", "all", [[0, 0], [1, 0]]),
        (f"{PLACED}*ELSET, ELSET=_S, INSTANCE=A\n7\n*SURFACE, NAME=foot\n_S, S4\n", "A", [[2, 0], [1, 0]]),
    ],
)  # fmt: skip
def test_abaqus_files_place_and_name_what_they_say(
    text: str, group: str | None, foot: list[list[float]], tmp_path: Path
) -> None:
    (tmp_path / "a.inp").write_text(text)
    mesh = read_mesh(tmp_path / "a.inp", group)
    assert mesh.points[mesh.rings[0]].shape == (1, 4, 2)
    named = mesh.points[mesh.node_sets["foot"]] if mesh.node_sets else places(mesh, "foot")
    assert sorted(named.round(12).tolist()) == sorted(foot)


@pytest.mark.parametrize("other", ["*SURFACE, NAME=two\n7, S1\n", FOOT])
def test_a_surface_that_shares_an_edge_with_another_group_is_left_out(other: str, tmp_path: Path) -> None:
    surfaces = "*SURFACE, NAME=one\nall, S1\n*SURFACE, NAME=top\n7, S3\n"
    (tmp_path / "a.inp").write_text(NODES + FACE + surfaces + other)
    assert read_mesh(tmp_path / "a.inp").names == ("top",)


def test_quadratic_lines_of_abaqus_have_their_middle_second(tmp_path: Path) -> None:
    middles = "5, 0.5, 0\n6, 1, 0.5\n7, 0.5, 1\n8, 0, 0.5\n"
    faces = "*ELEMENT, TYPE=CPS8\n1, 1, 2, 3, 4,\n5, 6, 7, 8\n*ELEMENT, TYPE=T3D3, ELSET=foot\n2, 1, 5, 2\n"
    (tmp_path / "a.inp").write_text(NODES + middles + faces)
    assert read_mesh(tmp_path / "a.inp").lines.tolist() == [[0, 4], [4, 1]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{NODES}*INCLUDE, INPUT=more.inp\n", r"line 6, \*INCLUDE"),
        (f"{NODES}*Element, type=CPS4, input=more.inp\n", r"line 6, \*ELEMENT: INPUT"),
        (f"{NODES}*NGEN\n1, 9, 2\n", r"line 6, \*NGEN"),
        (f"{NODES}*ELEMENT, TYPE=CAX4\n1, 1, 2, 3, 4\n", 'line 6, .* type "CAX4"'),
        (f"{NODES}*ELEMENT, TYPE=CPS4\n1, 1, 2, 3\n", "have 4 nodes"),
        (f"{NODES}*ELEMENT, TYPE=CPS3\n1, 1, 2, 9\n", "element 1 refers to node 9"),
        (f"{NODES}{FACE}{FACE}", "element 7 has been defined before"),
        (f"{NODES}1, 0, 5\n", "node 1 has been defined before"),
        ("*NODE\n1, x, 0\n", 'line 1, .*"x" is not a number'),
        (f"{PART}*Instance, name=A, part=Q\n", 'there is no part "Q"'),
        (f"{NODES}{FACE}*NSET, NSET=a\nfeet\n", 'there is no set "feet"'),
        (f"{NODES}{FACE}*NSET, NSET=a, INSTANCE=B\n1\n", 'there is no instance "B"'),
    ],
)
def test_what_is_refused_of_abaqus_files_is_located(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.inp").write_text(text)
    with pytest.raises(GeometryError, match=words):
        read_mesh(tmp_path / "a.inp")


GMSH = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "foot"
1 2 "edge"
2 3 "plate"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 1 0 0 2 1 2 0
1 0 0 0 1 1 0 1 3 1 1
$EndEntities
$Nodes
1 3 1 3
2 1 0 3
1
2
3
0 0 0
1 0 0
1 1 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 2 1
2 1 2 3
$EndElements
"""


@pytest.mark.parametrize(("named", "groups"), [(True, "foot, edge"), (False, "physical1, physical2")])
def test_an_edge_in_two_groups_of_a_gmsh_file_is_refused(named: bool, groups: str, tmp_path: Path) -> None:
    head, names, rest = GMSH.partition("$PhysicalNames")[0], GMSH, GMSH.partition("$EndPhysicalNames\n")[2]
    text = names if named else head + rest
    (tmp_path / "a.msh").write_text(text)
    with pytest.raises(GeometryError, match=f"several groups: {groups}"):
        read_mesh(tmp_path / "a.msh")
    (tmp_path / "a.msh").write_text(text.replace("2 1 2 0", "1 1 0"))
    assert read_mesh(tmp_path / "a.msh").names == (groups.partition(",")[0],)


def test_elements_of_a_gmsh_file_without_a_group(tmp_path: Path) -> None:
    (tmp_path / "a.msh").write_text(GMSH.replace("2 1 2 0", "0 0"))
    assert read_mesh(tmp_path / "a.msh", "plate").names == ("",)


def test_formats_of_several_files_and_links_in_hdf5_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.xdmf", SQUARE, TWO)
    write(tmp_path / "a.h5m", SQUARE, TWO[1:])
    assert len(read_mesh(tmp_path / "a.h5m").points) == 3
    with h5py.File(tmp_path / "a.h5m", "a") as file:
        file["far"] = h5py.ExternalLink("other.h5", "/")
    for name, words in {"a.xdmf": "refer to other files", "a.h5m": "/far is a link"}.items():
        with pytest.raises(GeometryError, match=words):
            read_mesh(tmp_path / name)


@pytest.mark.parametrize("compression", ["zlib", "lzma"])
def test_a_compressed_file_unpacks_to_a_limit(
    compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = np.zeros((5000, 3))
    points[:5] = SQUARE
    mesh = meshio.Mesh(points, TWO)
    meshio.vtu.write(tmp_path / "a.vtu", mesh, compression=compression)
    assert len(read_mesh(tmp_path / "a.vtu").points) == 5
    monkeypatch.setattr(self_contained, "MAX_BYTES", 100_000)
    with pytest.raises(GeometryError, match="too large when unpacked"):
        read_mesh(tmp_path / "a.vtu")
