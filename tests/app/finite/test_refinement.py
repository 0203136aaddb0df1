"""Contacts at finite strain make their nodes finer by what a first run finds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mlsanm_cli.app.run import resume, run
from tests.app.finite.finite_scenes import neo_hookean, rubber
from tests.app.runs import resumed_differences, warned
from tests.app.scenes import Quiet, solve
from tests.app.test_resume import Killed
from tests.case_text import (
    annulus,
    body,
    box,
    contact,
    disk,
    head,
    item,
    load,
    pushed,
    support,
    table,
)


def pressed(spacing: float | None = None, depth: float = 0.01) -> str:
    """A block on which a small disk is pressed, beside its nodes."""
    obstacle = {"kind": "disk", "center": [0.031, 1.2], "radius": 0.2}
    return (
        rubber(2.6, 0.3)
        + body("pad", "rubber", spacing, box([-0.7, 0.7], [0.3, 1.0]))
        + support("pad.bottom", ux=0.0, uy=0.0)
        + table("mls", degree=2)
        + contact("c", "pad.top", obstacle=obstacle)
        + pushed("press", "c", uy=-depth)
    )


def lean(summary: object) -> float:
    assert isinstance(summary, dict)
    x, y = summary["forces"]["press"]
    return float(abs(x / y))


class Second(Quiet):
    """A console that dies at the second step of the second run."""

    def __init__(self) -> None:
        super().__init__()
        self._seen = 0

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        super().step(index, position, residual, text)
        self._seen += index == 2
        if self._seen == 2:
            raise Killed


def test_few_nodes_in_contact_are_made_finer(tmp_path: Path) -> None:
    """The force is upright to a thousandth. Nodes of the case's own stay: it leans as these lie, by percents,
    which is told. A run with finer ones that is cut short goes on with them."""
    coarse = solve(pressed(0.1), tmp_path / "coarse")
    warning = " ".join(coarse["warnings"])
    told = re.search(r"([0-9.]+) %: use", warning)
    assert told
    assert 0.01 < lean(coarse) < 0.01 * float(told[1])
    finer = solve(pressed(), tmp_path / "finer")
    assert not any("contact c" in one for one in finer["warnings"])
    assert finer["nodes"] < 1200
    assert lean(finer) < 1e-3
    assert finer["error_estimate"]["contacts"]["c"] <= 1e-3
    with pytest.raises(Killed):
        run(tmp_path / "finer.toml", out=tmp_path / "cut", console=Second())
    resumed = resume(tmp_path / "cut", console=Quiet())
    assert resumed["nodes"] == finer["nodes"]
    assert resumed["error_estimate"]["contacts"] == pytest.approx(finer["error_estimate"]["contacts"])
    assert resumed_differences(tmp_path / "finer", tmp_path / "cut") == []


def test_a_disk_that_touches_between_nodes_is_told(tmp_path: Path) -> None:
    """A flat side has no turn of its own: the force was zero, without a word."""
    summary = solve(pressed(0.1, depth=1e-5), tmp_path / "run")
    assert summary["forces"]["press"] == [0.0, 0.0]
    assert "contact_between_nodes" in warned(summary)


RUBBER = neo_hookean("rubber", 3.0, 0.4)
SMALL = {
    "bush": (
        body("part", "rubber", None, annulus([0.0, 0.0], [1.0, 2.0]))
        + support("part.outer", ux=0.0, uy=0.0)
        + load("press", "part.inner", "platen", displacement=[0.0, -1e-4])
    ),
    "disk on a block": (
        body("part", "rubber", 0.15, box([-1.0, 1.0], [-1.0, 0.0]))
        + item("body.refine", at=[0.0, 0.0], spacing=0.002, radius=0.02, growth=0.2)
        + support("part.bottom", ux=0.0, uy=0.0)
        + contact("c", "part.top", obstacle=disk([0.0, 0.5], 0.5))
        + pushed("press", "c", uy=-1e-3)
    ),
}


@pytest.mark.parametrize("name", SMALL)
def test_small_loads_have_the_forces_of_small_strain(name: str, tmp_path: Path) -> None:
    """To a thousandth; the disk is pressed by two thousandths of its radius."""
    scene, linear = SMALL[name], RUBBER.replace('law = "neo-hookean"\n', "")
    found = solve(head("strain", strain="finite") + RUBBER + scene, tmp_path / "finite")
    expected = solve(head("strain") + linear + scene, tmp_path / "small")
    force = expected["forces"]["press"][1]
    assert found["forces"]["press"] == pytest.approx([0.0, force], abs=1e-3 * abs(force))
