"""Outlines of sides and curves, boundaries of several pieces, lists and parts: what a case may say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.scene.imported import geometry_of
from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.case import case_hash, load_case, parse_case, resolved_mapping
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.summary import toml_text
from tests.case.scenes import only, parse, problems
from tests.case_text import body, head, item, load, material, support, table

WAVY = (
    head("strain")
    + material("m", E=1.0, nu=0.3)
    + body("block", "m")
    + table("body.shape", kind="outline")
    + item(
        "body.shape.sides", name="top", points=[[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1], [4.0, 0.0]]
    )
    + item("body.shape.sides", name="right", to=[4.0, -1.0])
    + item("body.shape.sides", name="bottom", to=[0.0, -1.0])
    + item("body.shape.sides", name="left")
    + support(["block.bottom", "block.left"], ux=0.0, uy=0.0)
    + load("press", "block.top", "pressure", pressure=1.0, from_=[1.0, 0.1], to=[3.0, 0.1])
)
SIDES = "body.block.shape.sides"


def test_sides_in_either_direction_are_the_same_outline() -> None:
    shape = parse(WAVY).case.body[0].shape
    geometry = geometry_of(shape)
    assert set(geometry.normals) == {"top", "right", "bottom", "left"}
    assert (geometry.size, geometry.normals["right"], geometry.normals["top"]) == (4.0, (1.0, 0.0), None)
    outline = drawn(shape)
    assert outline.names == ("left", "bottom", "right", "top")
    ends = [curve.points(np.array([0.0, curve.length])) for curve in outline.curves]
    for one, other in zip(ends, [*ends[1:], ends[0]], strict=True):
        assert np.abs(one[1] - other[0]).max() < 1e-12
    text = WAVY.replace("[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1], [4.0, 0.0]", "POINTS")
    text = text.replace("POINTS", "[4.0, 0.0], [3.0, 0.1], [2.0, 0.0], [1.0, 0.1], [0.0, 0.0]")
    text = text.replace("to = [4.0, -1.0]", "to = [0.0, -1.0]", 1)
    text = text.replace('"bottom"\nto = [0.0, -1.0]', '"bottom"\nto = [4.0, -1.0]')
    turned = drawn(parse(text).case.body[0].shape)
    s = np.linspace(0.0, outline.curves[3].length, 11)
    top = turned.curves[turned.names.index("top")]
    assert np.abs(top.points(s) - outline.curves[3].points(s)).max() < 1e-12


def test_points_of_a_file_stand_in_the_resolved_case(tmp_path: Path) -> None:
    inline = parse(WAVY).case
    points = "points = [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1], [4.0, 0.0]]"
    text = WAVY.replace(points, 'file = "profile.csv"')
    (tmp_path / "profile.csv").write_text("x,y\n0,0\n1,0.1\n2,0\n3,0.1\n4,0\n")
    (tmp_path / "case.toml").write_text(text)
    loaded = load_case(tmp_path / "case.toml")
    assert case_hash(loaded.case) == case_hash(inline)
    again = parse_case(toml_text(resolved_mapping(loaded.case)), Path("elsewhere.toml"))
    assert again.case == loaded.case
    (tmp_path / "profile.csv").write_text("a,b\n0,0\n")
    with pytest.raises(CaseError, match="must begin with the line x,y"):
        load_case(tmp_path / "case.toml")
    (tmp_path / "profile.csv").unlink()
    with pytest.raises(CaseError) as caught:
        load_case(tmp_path / "case.toml")
    assert [problem.key for problem in caught.value.problems] == [f"{SIDES}.top.file"]


@pytest.mark.parametrize(
    ("setting", "key", "words"),
    [
        (f"{SIDES}.right.to=[4.0, 2.0]", SIDES, "cross or touch"),
        (f"{SIDES}.left.to=[0.0, -0.5]", f"{SIDES}.top", '"left" ends at (0, -0.5)'),
        (f"{SIDES}.right.points=[[4.0, 0.0], [4.0, -1.0]]", f"{SIDES}.right.points", '"to" is given too'),
        (f"{SIDES}.top.points=[[0.0, 0.0], [0.0, 0.0]]", f"{SIDES}.top.points.1", "repeats"),
        (f"{SIDES}=[{{to = [1.0, 0.0]}}, {{}}]", f"{SIDES}.0", "is missing"),
        (f"{SIDES}.left.too=[0.0, 0.0]", f"{SIDES}.left.too", 'did you mean "to"'),
        ("load.press.to=[1.0, 0.1]", "load.press.to", "the same point"),
        ("support.0.boundary=['block.left', 'block.left']", "support.0.boundary", "listed twice"),
        ("support.0.boundary=['block.left', 'other.top']", "support.0.boundary", "one body"),
        ("support.0.boundary=['block.left', 'block.lid']", "support.0.boundary.1", 'no boundary "lid"'),
        ("support.0.from=[0.0, 0.0]", "support.0.from", 'needs "to" too'),
    ],
)
def test_what_can_be_wrong(setting: str, key: str, words: str) -> None:
    told = {problem.key: str(problem) for problem in problems(WAVY, [setting])}
    assert words in told[key], told


def test_sides_and_arcs_of_one_name_are_one_boundary() -> None:
    text = WAVY[: WAVY.index("kind")] + (
        'kind = "polygon"\npoints = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]\n'
        'names = ["foot", "foot", "top", "left"]\nrounding = [0.2, 0.3, 0.4, 0.0]\n'
        'corners = ["foot", "", "", ""]\n'
    )
    text += WAVY[WAVY.index("[[support]]") :].replace("block.bottom", "block.foot")
    shape = parse(text).case.body[0].shape
    outline = drawn(shape)
    assert outline.names == ("foot/1", "foot/2", "foot/3", "foot/4", "corner3", "top", "left")
    assert only(text, ["body.block.shape.names=['foot', 'corner3', 'top', 'left']"]).key.endswith("names.1")
