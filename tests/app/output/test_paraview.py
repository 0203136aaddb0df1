"""Files for ParaView: bodies are filled, contacts and obstacles are lines; what VTK makes of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import BAR, done, solve
from tests.case_text import EXACT, scene


def read(path: Path) -> Any:
    return meshio.read(path, file_format="vtu")


def listed(path: Path) -> list[dict[str, str]]:
    return [dict(one.attrib) for one in ET.parse(path).getroot().findall("Collection/DataSet")]


def area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, corner], :2] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.asarray(0.5 * twice)


ROOT = Path(__file__).parents[3]
NO_VTK = "the extra test-vtk is not installed"
AREAS = {"cylinder": 0.5 * np.pi, "block": 8.0}
CYLINDER = (
    scene("strain", "rubber", E=10.0, nu=0.3)
    .body("pad", "rubber", 0.25, box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
    .pushed("down", "drum", uy=-0.02)
    .contact("drum", "pad.top", accuracy=0.01, friction=0.3, disk=([0.0, 1.0], 1.0), regularization=EXACT)
    .table("output", at=[0.5, 1.0])
)


@pytest.fixture(scope="module")
def drum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rigid disk pressed with friction on a pad."""
    directory = tmp_path_factory.mktemp("drum") / "run"
    done(CYLINDER, directory)
    return directory


def test_bodies_are_filled_with_triangles_and_keep_their_points(hertz_run: Path) -> None:
    run = read_run(hertz_run)
    for entry in listed(hertz_run / "fields.pvd"):
        mesh = read(hertz_run / entry["file"])
        (cells,) = mesh.cells
        assert cells.type == "triangle"
        np.testing.assert_array_equal(mesh.points[:, :2], run.bodies[entry["name"]].points)
        parts = area(mesh.points, cells.data)
        assert parts.min() > 0.0
        assert parts.sum() == pytest.approx(AREAS[entry["name"]], rel=0.01)


def test_contact_lines_tell_pressures_and_lie_on_the_moved_surface(drum: Path) -> None:
    run = read_run(drum)
    entries = [entry for entry in listed(drum / "contacts.pvd") if entry["name"] == "contacts"]
    assert [float(entry["timestep"]) for entry in entries] == [0.5, 1.0]
    contact = run.contacts["drum"]
    for entry in entries:
        mesh = read(drum / entry["file"])
        (cells,) = mesh.cells
        assert cells.type == "line"
        data = mesh.point_data
        row = int(np.flatnonzero(run.path.position == float(entry["timestep"]))[-1])
        for name in ("pressure", "traction", "slip", "status", "gap"):
            np.testing.assert_array_equal(data[name], getattr(contact, name)[row])
        stress = data["contact_stress"][:, :2]
        force = (contact.weight[:, None] * stress).sum(axis=0)
        np.testing.assert_allclose(force, run.path.resultants["down"][row], rtol=1e-6, atol=1e-4)
        # Where it is pressed, the surface has moved down to the drum's.
        pressed = data["pressure"] > 0.2 * data["pressure"].max()
        moved = (mesh.points + data["displacement"])[pressed, :2]
        down = 0.02 * float(entry["timestep"])
        away = np.hypot(moved[:, 0], moved[:, 1] - (1.0 - down)) - 1.0
        assert np.abs(away).max() < 2e-3 * down / 0.02


def test_obstacles_are_lines_that_move_with_their_loads(drum: Path) -> None:
    entries = [entry for entry in listed(drum / "contacts.pvd") if entry["name"] == "obstacles"]
    mesh = read(drum / entries[-1]["file"])
    np.testing.assert_allclose(np.hypot(mesh.points[:, 0], mesh.points[:, 1] - 1.0), 1.0)
    np.testing.assert_allclose(mesh.point_data["displacement"], np.tile([0.0, -0.02, 0.0], (181, 1)))
    assert [cells.type for cells in mesh.cells] == ["line"]


def test_scenes_without_contact_have_no_contact_files(bar_run: Path) -> None:
    assert not [path for path in bar_run.iterdir() if path.name.startswith(("contacts", "obstacles"))]


@pytest.mark.parametrize("kind", ["bodies", "lines"])
def test_vtk_fills_and_warps_without_a_filter_before(drum: Path, hertz_run: Path, kind: str) -> None:
    vtk = pytest.importorskip("vtk", reason=NO_VTK)
    if kind == "lines":
        # Half the peak pressure is met once on either side of the middle.
        assert isolines(vtk, drum / "contacts_0001.vtu", "pressure").GetNumberOfPoints() == 2
        return
    assert isolines(vtk, hertz_run / "fields_0005.vtu", "von_mises").GetNumberOfLines() > 20
    surface, filled = bands(vtk, hertz_run / "fields_0005.vtu", "von_mises")
    assert filled >= surface > 500


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "cases").glob("*.toml")))
def test_vtk_shows_every_published_case(name: str, tmp_path: Path) -> None:
    """At the end: bodies filled and warped, with isolines, and contacts as lines."""
    vtk = pytest.importorskip("vtk", reason=NO_VTK)
    case = ROOT / "cases" / f"{name}.toml"
    done(case.read_text(), tmp_path / "run")
    entries = listed(tmp_path / "run" / "fields.pvd")
    for entry in entries[-len(read_run(tmp_path / "run").bodies) :]:
        file = tmp_path / "run" / entry["file"]
        surface, filled = bands(vtk, file, "von_mises")
        assert filled >= surface > 100
        assert isolines(vtk, file, "von_mises").GetNumberOfLines() > 0
    if read_run(tmp_path / "run").contacts:
        last = [one for one in listed(tmp_path / "run" / "contacts.pvd") if one["name"] == "contacts"][-1]
        assert isolines(vtk, tmp_path / "run" / last["file"], "pressure").GetNumberOfPoints() > 0


def warped(vtk: Any, file: Path) -> Any:
    """A file moved by its displacements, and nothing else."""
    reader, warp = vtk.vtkXMLUnstructuredGridReader(), vtk.vtkWarpVector()
    reader.SetFileName(str(file))
    warp.SetInputConnection(reader.GetOutputPort())
    warp.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "displacement")
    warp.Update()
    return warp.GetOutput()


def isolines(vtk: Any, file: Path, scalar: str) -> Any:
    """Where a scalar is in the middle of its range, on what is moved."""
    grid, isoline = warped(vtk, file), vtk.vtkContourFilter()
    isoline.SetInputData(grid)
    isoline.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, scalar)
    low, high = grid.GetPointData().GetArray(scalar).GetRange()
    isoline.SetValue(0, 0.5 * (low + high))
    isoline.Update()
    return isoline.GetOutput()


def bands(vtk: Any, file: Path, scalar: str) -> tuple[int, int]:
    """Number of cells of a moved body, and of the parts that bands of a scalar divide it into."""
    surface, filled = vtk.vtkGeometryFilter(), vtk.vtkBandedPolyDataContourFilter()
    surface.SetInputData(warped(vtk, file))
    surface.Update()
    surface.GetOutput().GetPointData().SetActiveScalars(scalar)
    filled.SetInputData(surface.GetOutput())
    filled.GenerateValues(6, surface.GetOutput().GetPointData().GetArray(scalar).GetRange())
    filled.Update()
    return surface.GetOutput().GetNumberOfPolys(), filled.GetOutput().GetNumberOfPolys()


def test_strains_are_written_where_they_are_asked_for(tmp_path: Path) -> None:
    """A bar pulled, squeezed and warmed: (s - nu q) / E + a T along, and so on."""
    text = BAR.changed("nu = 0.25", "nu = 0.25\nalpha = 1e-5").heat("heat", "bar", 20.0)
    text = text.changed("pull = 1.0", "pull = 1.0\nheat = 1.0")
    done(text, tmp_path / "run", 'output.fields=["displacement", "strain"]')
    run = read_run(tmp_path / "run")
    strain = run.states[-1].bodies["bar"]["strain"]
    along = (30.0 - 0.25 * -40.0) / 200e3 + 2e-4
    across = (-40.0 - 0.25 * 30.0) / 200e3 + 2e-4
    np.testing.assert_allclose(strain, np.tile([along, across, 0.0], (len(strain), 1)), atol=1e-12)
    data = read(tmp_path / "run" / "fields_0002.vtu").point_data
    assert set(data) == {"boundary_tag", "displacement", "strain"}
    np.testing.assert_array_equal(data["strain"][:, [0, 4, 1, 3]], strain[:, [0, 1, 2, 2]])


def test_shear_strains_are_halves_of_angles(tmp_path: Path) -> None:
    text = BAR.changed('kind = "traction"\ntraction = [30.0, 0.0]', 'kind = "displacement"\nuy = 0.01')
    solve(text, tmp_path / "run", 'output.fields=["displacement", "stress", "strain"]', "output.at=[1.0]")
    fields = read_run(tmp_path / "run").states[0].bodies["bar"]
    shear = 200e3 / (2.0 * 1.25)
    np.testing.assert_allclose(fields["strain"][:, 2], fields["stress"][:, 2] / (2.0 * shear), rtol=1e-9)
