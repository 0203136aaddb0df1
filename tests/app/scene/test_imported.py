"""Bodies from files through check and run: results, round trip, and everything that is wrong with a file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import case_hash
from mlsanm_cli.cli import main
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet
from tests.case_text import Scene, scene

DATA = Path(__file__).parents[2] / "data"


def pulled(spacing: float | None = None, use: str | None = None, left: float = -5.0, **more: Any) -> Scene:
    """A plate from a mesh, which ends at ``left``, held there and pulled at the other end."""
    shape = {"kind": "mesh", "file": "plate.msh"} | ({"use": use} if use else {})
    return (
        scene("stress")
        .body("plate", "steel", spacing, **more)
        .table("body.shape", **shape)
        .support("plate.left", ux=0.0)
        .pin("plate", [left, 0.0], uy=0.0)
        .load("pull", "plate.right", "traction", traction=[100.0, 0.0])
    )


PULLED = pulled()
CLOUD = PULLED.changed('"mesh"', '"points"').changed("plate.msh", "plate.csv")


def write(folder: Path, text: str) -> Path:
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def polar_plate(around: int, half: float) -> tuple[FloatArray, IntArray]:
    """Quads between a hole of radius 1 and a square of half-width ``half``, as near to squares as can be."""
    angle = 2.0 * np.pi * (np.arange(around) + 0.5) / around
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = half * circle / np.abs(circle).max(axis=1)[:, None]
    corner = np.arange(around // 8, around, around // 4)
    square[corner] = half * np.sign(circle[corner])
    rings = round(around / (2.0 * np.pi) * np.log(half))
    part = np.expm1(np.linspace(0.0, np.log(half), rings + 1)) / (half - 1.0)
    points = np.concatenate([circle + p * (square - circle) for p in part])
    one = np.arange(around * rings).reshape(rings, around)
    quads = np.stack(
        [one, np.roll(one, -1, axis=1), np.roll(one, -1, axis=1) + around, one + around], axis=-1
    )
    return points, quads.reshape(-1, 4)


def write_gmsh(path: Path, points: FloatArray, quads: IntArray) -> None:
    """Clockwise quads, with the left and right sides as groups."""
    sides = {"right": 1.0, "left": -1.0}
    edges = np.stack([quads[:, 2], quads[:, 3]], axis=1)
    x = points[edges][:, :, 0]
    lines = [edges[np.isclose(x, sign * points[:, 0].max()).all(axis=1)] for sign in sides.values()]
    cells = [("quad", quads[:, ::-1]), ("line", np.concatenate(lines))]
    tags = [np.full(len(quads), 9), np.repeat([1, 2], [len(line) for line in lines])]
    meshio.Mesh(
        np.pad(points, ((0, 0), (0, 1))),
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([k, 1]) for k, name in enumerate(sides, 1)},
    ).write(path, file_format="gmsh22", binary=False)


@pytest.mark.parametrize("use", ["nodes", "outline"])
def test_stress_concentration_of_a_mesh_used_both_ways(use: str, tmp_path: Path) -> None:
    # cases/kirsch.toml with this width, degree 6 and 300 nodes around the hole has 3.021.
    write_gmsh(tmp_path / "plate.msh", *polar_plate(96, 20.0))
    refine = {"along": "edge3", "spacing": 0.05, "radius": 0.0, "growth": 0.14}
    text = pulled(4.0, "outline", -20.0, refine=[refine]) if use == "outline" else pulled(left=-20.0)
    case, out = write(tmp_path, text), tmp_path / "out"
    summary = run(case, overrides=("mls.degree=4",), out=out, console=Quiet())
    assert summary["status"] == "done"
    assert not summary["warnings"]
    state = read_run(out)
    points, stress = state.bodies["plate"].points, state.states[-1].bodies["plate"]["stress"]
    rim = np.hypot(*points.T) < 1.0 + 1e-6
    assert rim.sum() >= 80
    assert abs(stress[rim, 0].max() / 302.1 - 1.0) <= 0.01


def test_points_with_tags_are_a_body_and_pull_evenly(tmp_path: Path) -> None:
    x, y = (one.ravel() for one in np.meshgrid(np.linspace(-5.0, 5.0, 11), np.linspace(-2.0, 2.0, 6)))
    grid = np.stack([x, y], axis=1)
    tag = np.select([x == -5.0, x == 5.0, y == -2.0, y == 2.0], ["left", "right", "bottom", "top"], "")
    rows = "".join(f"{x},{y},{name}\n" for (x, y), name in zip(grid, tag, strict=True))
    (tmp_path / "plate.csv").write_text("x,y,tag\n" + rows)
    summary = run(write(tmp_path, CLOUD), out=tmp_path / "out", console=Quiet())
    assert (summary["nodes"], summary["symmetry"]) == (66, "x = 0")
    stress = read_run(tmp_path / "out").states[-1].bodies["plate"]["stress"]
    assert stress == pytest.approx(np.tile([100.0, 0.0, 0.0], (66, 1)), abs=1e-6)


def test_the_resolved_case_names_the_file_and_its_content(tmp_path: Path) -> None:
    (tmp_path / "plate.msh").write_text((DATA / "plate22.msh").read_text())
    run(write(tmp_path, PULLED), out=tmp_path / "elsewhere" / "out", console=Quiet())
    # Pictures need the run only.
    (tmp_path / "plate.msh").rename(tmp_path / "gone.msh")
    assert plot(tmp_path / "elsewhere" / "out")
    (tmp_path / "gone.msh").rename(tmp_path / "plate.msh")
    resolved = tmp_path / "elsewhere" / "out" / "resolved.toml"
    first, second = read_case(tmp_path / "case.toml"), read_case(resolved)
    assert first.case == second.case
    moved = tmp_path / "moved"
    moved.mkdir()
    (moved / "plate.msh").write_text((DATA / "plate22.msh").read_text())
    assert read_case(write(moved, PULLED)).case_hash == first.case_hash == case_hash(second.case)
    (tmp_path / "plate.msh").write_text((DATA / "plate22.msh").read_text() + "\n")
    with pytest.raises(CaseError, match="it has changed since the case was resolved"):
        read_case(resolved)
    assert read_case(tmp_path / "case.toml").case_hash != first.case_hash


GOOD = (DATA / "plate22.msh").read_text()
RING = [(np.cos(a), np.sin(a), "rim") for a in 2.0 * np.pi * np.arange(24) / 24]


def csv(rows: list[tuple[object, ...]], header: str = "x,y,tag") -> str:
    return "\n".join([header, *(",".join(map(str, row)) for row in rows), ""])


def ring_case(text: Scene) -> Scene:
    """A body of that kind held at its only boundary, rim."""
    supported = Scene(re.sub(r"plate\.(left|right)", "plate.rim", text).partition("[[load]]")[0])
    return supported.load("p", "plate.edge", "pressure", pressure=1.0)


def mesh(text: str, words: tuple[str, ...], line: str, content: str = GOOD) -> tuple[Any, ...]:
    return text, "plate.msh", content, words, line


def points(rows: list[tuple[object, ...]], *words: str, text: str = "", header: str = "x,y,tag") -> Any:
    return text or ring_case(CLOUD), "plate.csv", csv(rows, header), words, "file ="


# The case, the file's name and content, what the message names, and how the line told begins.
BAD = {
    "missing file": (PULLED, "other.msh", GOOD, ("there is no file", "plate.msh"), "file ="),
    "broken mesh": mesh(PULLED, ("plate.msh: meshio cannot read it",), "file =", GOOD[: len(GOOD) // 2]),
    "empty mesh": mesh(PULLED, ("plate.msh",), "file =", ""),
    "missing group": mesh(
        PULLED.changed("plate.right", "plate.rigth"),
        ('no boundary "rigth"', "plate.right"),
        'boundary = "plate.rigth',
    ),
    "missing group of elements": mesh(
        PULLED.changed('"plate.msh"', '"plate.msh"\ngroup = "steel"'),
        ('no group of elements "steel"', "sheet"),
        "file =",
    ),
    "spacing of given nodes": mesh(
        pulled(1.0), ("body.plate.spacing", "does not apply", 'use = "outline"'), "spacing ="
    ),
    "refined nodes": mesh(PULLED + "[adapt]\npasses = 1\n", ("cannot be refined",), "passes ="),
    "reference without radius": mesh(
        PULLED + '[reference]\nsolution = "hertz-line"\n', ("needs a [[contact]]",), "solution ="
    ),
    "empty boundary": points(
        [(0, 0, ""), (1, 0, ""), (0, 1, "")], "plate.csv: no node has a tag", text=CLOUD
    ),
    "normals inward": points(
        [(x, y, t, -x, -y) for x, y, t in RING],
        "line 2: the normal at (1, 0) points inward",
        "24 such",
        header="x,y,tag,nx,ny",
    ),
    "duplicate nodes": points([*RING, (0, 0, ""), (0, 0, "")], "line 27", "that of line 26"),
    "crossing outline": points(
        [(x, (x + 0.1) * y, t) for x, y, t in RING], "the outline crosses itself near ("
    ),
    "nodes that form no curve": points([RING[5 * k % 24] for k in range(24)], "the outline crosses itself"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_end_with_one_clear_message(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, file, content, words, line = BAD[name]
    case = write(tmp_path, text)
    (tmp_path / file).write_text(content)
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    for word in words:
        assert word in message
    assert "Traceback" not in message
    number = next(k for k, row in enumerate(text.splitlines(), 1) if row.startswith(line))
    assert f"case.toml:{number}:" in message
    assert not (tmp_path / "out").exists()


def test_a_reference_needs_radii_that_the_case_states(tmp_path: Path) -> None:
    (tmp_path / "plate.msh").write_text(GOOD)
    text = (
        scene("stress")
        .body("plate", "steel", shape={"kind": "mesh", "file": "plate.msh"}, clamped="left")
        .body("block", "steel", 1.0, box=([5.0, 9.0], [-5.0, 5.0]), clamped="right")
        .load("pull", "plate.top", "traction", traction=[100.0, 0.0])
        .contact("c", "plate.right", "block.left")
        .table("reference", solution="uniform-pressure")
    )
    with pytest.raises(CaseError, match=r"the case gives none for plate\.right"):
        run(write(tmp_path, text), out=tmp_path / "out", console=Quiet())
