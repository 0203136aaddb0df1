"""Faults put into the numerics on purpose: a run fails, or misses the bar of its published case."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.response import load_vectors as sources
from mlsanm_cli.mechanics import assembly, body_model
from mlsanm_cli.mechanics.assembly import RowTable
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.near_field import PointForceField
from mlsanm_cli.mechanics.pieces import Pieces
from mlsanm_cli.mechanics.remainder import remainder_sources
from mlsanm_cli.mechanics.springs import Held
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from tests.app.scenes import EXACT_LAW, Quiet

CASES = Path(__file__).parents[2] / "cases"
COARSE = "contact.interface.accuracy=1e-2"


def outcome(name: str, directory: Path, *overrides: str) -> Mapping[str, Any]:
    """Summary of a run of a published case without fields."""
    quiet = ("output.fields=[]", "output.vtu=false", *overrides)
    return run(CASES / f"{name}.toml", overrides=quiet, out=directory, console=Quiet())


def traction_weights_times(factor: Callable[[float], float]) -> Callable[..., FloatArray]:
    """The body's row weights with those of the traction rows multiplied by ``factor`` of the modulus."""
    proper = assembly.row_weights

    def faulty(
        model: BodyModel,
        held: Mapping[str, tuple[bool, bool]],
        held_nodes: Sequence[tuple[int, int]],
        table: RowTable,
        restraints: Held,
        touching: Collection[str],
    ) -> FloatArray:
        weights, cloud = proper(model, held, held_nodes, table, restraints, touching), model.cloud
        first = 2 * len(cloud.points)
        for name, surface in cloud.surfaces.items():
            for holds in held.get(name, (False, False)):
                if not holds:
                    weights[first : first + len(surface.index)] *= factor(table.modulus)
                first += len(surface.index)
        return weights

    return faulty


@pytest.mark.parametrize("case", ["lame", "self_weight"])
def test_pieces_that_know_of_no_load(case: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("per_column", "gathered"):
        proper = getattr(Pieces, name)
        monkeypatch.setattr(Pieces, name, lambda *some, proper=proper: 0.0 * proper(*some))
    monkeypatch.setattr(Pieces, "of_force", lambda pieces, force: np.zeros(3 * pieces.count))
    summary = outcome(case, tmp_path / "run")
    assert summary["status"] == "failed"


@pytest.mark.parametrize(
    "factor", [lambda modulus: modulus, lambda modulus: 1e-3], ids=["in-stress", "light"]
)
def test_dropped_weights_of_tractions(
    factor: Callable[[float], float], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(assembly, "row_weights", traction_weights_times(factor))
    # Not that of a patch test, whose solution obeys all rows however they are weighted.
    summary = outcome("hertz", tmp_path / "run", EXACT_LAW)
    if summary["status"] == "failed":
        assert summary["stop_reason"] != "end of the last stage"
    else:
        # What is badly weighted may be solved all the same; its estimate is then four times as large.
        assert summary["error_estimate"]["displacement"] >= 1e-3


def test_stencils_across_bodies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    seen: list[FloatArray] = []

    def faulty(
        points: FloatArray, tree: cKDTree, targets: FloatArray, order: int, *rest: Any, **named: Any
    ) -> Stencils:
        """At virtual nodes, neighbours from the body that was built first, under its numbers."""
        seen.append(points)
        first = seen[0]
        if order > 0 or len(first) == len(points):
            return build_stencils(points, tree, targets, order, *rest, **named)
        taken = build_stencils(first, cKDTree(first), targets, order, *rest, **named)
        return replace(taken, indices=taken.indices % len(points), nodes=len(points))

    monkeypatch.setattr(body_model, "build_stencils", faulty)
    summary = outcome("hertz", tmp_path / "run", EXACT_LAW)
    assert len({len(points) for points in seen}) == 2
    # No certificate knows of it, but seven times the published bar does.
    assert summary["contacts"]["interface"]["reference"]["pressure_error_l2"] >= 0.02


def test_remainders_of_half_the_forces(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    proper = remainder_sources
    monkeypatch.setattr(sources, "remainder_sources", lambda *rest: 0.5 * proper(*rest))
    (warning,) = outcome("hertz", tmp_path / "run", EXACT_LAW)["warnings"]
    assert warning.startswith("force imbalance on body cylinder: 9")


def test_half_of_a_contact_s_singular_field(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    proper = ContactGrid.singular

    def faulty(near: ContactGrid, kernel: PointForceField, slave: bool) -> tuple[FloatArray, FloatArray]:
        log, turn = proper(near, kernel, slave)
        return 0.5 * log, 0.5 * turn

    monkeypatch.setattr(ContactGrid, "singular", faulty)
    assert outcome("hertz", tmp_path / "run", EXACT_LAW, COARSE)["status"] == "failed"
