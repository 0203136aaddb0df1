"""Remainders of bodies' answers to forces on their surfaces: exact solutions, and balance to round-off."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Outline, annulus, disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.mechanics import near_field
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic, orthotropic
from mlsanm_cli.mechanics.near_field import SurfaceForces, kernel_of
from mlsanm_cli.mechanics.remainder import reaction_of, remainder_sources
from mlsanm_cli.mechanics.supports import Held
from tests.mechanics.bodies import build

EVEN = isotropic(2.0, 0.3, "strain")
WOOD = orthotropic((5.0, 1.0, 1.0), (0.3, 0.3, 0.06), 0.5, 0.5, "strain")
MATERIALS = [pytest.param(EVEN, id="isotropic"), pytest.param(WOOD, id="wood")]
CLAMPED: Held = {"bottom": (True, True)}


def body_of(
    outline: Outline, spacing: float, degree: int, material: PlaneMaterial = EVEN, held: Held | None = None
) -> ElasticBody:
    """A body on a cloud of its own."""
    return build(build_cloud(outline, Spacing(spacing, ()), 0), held or {}, degree, material)


def solved(body: ElasticBody, source: FloatArray) -> FloatArray:
    """Answers (2n, c) to right-hand sides (r, c)."""
    return np.asarray(body.system.solve(sparse.csc_array(source)))


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("half", [0.5 * np.pi, 0.625 * np.pi, 0.3], ids=["diameter", "nodes", "chord"])
def test_disk_between_two_forces(degree: int, half: float) -> None:
    """Opposite unit forces along the chord from e^(-i half) to e^(i half) of a unit disk leave even tension
    sin(half) / pi (Timoshenko and Goodier, Theory of Elasticity, article 41)."""
    body = body_of(disk((0.0, 0.0), 1.0), 0.4, degree)
    assert len(body.model.cloud.points) == 24
    place = np.exp(1j * np.array([half, -half]))
    source = remainder_sources(body, SurfaceForces(kernel_of(EVEN), place, -place))
    moved = solved(body, source @ np.array([[0.0], [0.0], [-1.0], [1.0]])).reshape(-1, 2)
    even = np.sin(half) / np.pi * np.array([1.0, 1.0, 0.0])
    assert np.abs(body.model.stress(moved) - even).max() <= 1e-12


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("material", MATERIALS)
def test_sources_have_the_forces_and_their_moments(degree: int, material: PlaneMaterial) -> None:
    # Fields send as much back through the outline as they put in: the remainder has the whole force.
    body = body_of(rectangle((-2.0, 2.0), (-2.0, 0.0)), 0.4, degree, material)
    x = np.array([0.1, 1.1])
    forces = SurfaceForces(kernel_of(material), x + 0j, np.full(2, -1j))
    found = body.resultants() @ remainder_sources(body, forces)
    expected = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, *x]])
    assert found == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("material", MATERIALS)
def test_sources_around_holes(material: PlaneMaterial) -> None:
    body = body_of(annulus((0.0, 0.0), (1.0, 2.0)), 0.4, 2, material)
    place = np.exp(1j * np.array([0.3, 2.5]))
    forces = SurfaceForces(kernel_of(material), place, place, center=0.1 + 0.05j)
    found = body.resultants() @ remainder_sources(body, forces)
    expected = np.zeros((3, 4))
    expected[0, :2] = expected[1, 2:] = 1.0
    expected[2] = np.concatenate([-place.imag, place.real])
    assert found == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("about", [(0.0, 0.0), (0.5, -2.0)])
def test_reactions_are_minus_the_forces(material: PlaneMaterial, about: tuple[float, float]) -> None:
    body = body_of(rectangle((-2.0, 2.0), (-2.0, 0.0)), 0.3, 4, material, CLAMPED)
    x = np.array([0.1, 1.1])
    forces = SurfaceForces(kernel_of(material), x + 0j, np.full(2, -1j))
    moved = solved(body, remainder_sources(body, forces))
    found = body.reaction_rows("bottom", about) @ moved + reaction_of(body, "bottom", about, forces)
    moment = [about[1], about[1], *(x - about[0])]
    expected = -np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], moment])
    assert found == pytest.approx(expected, abs=5e-7)


def test_what_is_held_stays() -> None:
    # Field and remainder together do not move the bottom.
    body = body_of(rectangle((-2.0, 2.0), (-2.0, 0.0)), 0.3, 4, held=CLAMPED)
    forces = SurfaceForces(kernel_of(EVEN), np.array([0.1 + 0j]), np.array([-1j]))
    moved = solved(body, remainder_sources(body, forces))
    surface = body.model.cloud.surfaces["bottom"]
    points = body.model.cloud.points[surface.index]
    field = forces.displacement(near_field.as_complex(points))[:, 0]
    for component in (0, 1):
        rest = moved[2 * surface.index + component]
        assert rest + field[:, component] == pytest.approx(
            np.zeros_like(rest), abs=2e-3 * np.abs(field).max()
        )


@pytest.mark.parametrize("degree", [2, 4])
def test_answers_are_reciprocal(degree: int) -> None:
    # What a force at one place moves at another is what the other way round is moved.
    place = np.array([0.1 + 0j, 1.1 + 0j, -0.7 + 0j])

    def lopsided(spacing: float) -> float:
        body = body_of(rectangle((-2.0, 2.0), (-2.0, 0.0)), spacing, degree, held=CLAMPED)
        forces = SurfaceForces(kernel_of(EVEN), place, np.full(3, -1j))
        moved = solved(body, remainder_sources(body, forces))
        points, along = near_field.as_real(place), np.eye(2)
        rows = [body.model.values_along(points, np.tile(one, (3, 1))) @ moved for one in along]
        rest = np.concatenate(rows)
        return float(np.abs(rest - rest.T).max() / np.abs(rest).max())

    coarse, fine = lopsided(0.4), lopsided(0.2)
    assert coarse <= 0.05
    assert fine <= 0.5 * coarse


@pytest.mark.parametrize("material", MATERIALS)
def test_a_loose_body_has_no_mean_motion(material: PlaneMaterial) -> None:
    # A force at a node, one between two nodes, on a body that slides along its bottom or is not held at all.
    for held, components in (({"bottom": (False, True)}, (0,)), ({}, (0, 1, 2))):
        body = body_of(rectangle((-2.0, 2.0), (-2.0, 0.0)), 0.4, 4, material, held)
        assert body.free.components == components
        forces = SurfaceForces(kernel_of(material), np.array([0.0 + 0j, 1.1 + 0j]), np.full(2, -1j))
        source = remainder_sources(body, forces)
        cells = (np.arange(80) + 0.5) / 20.0 - 2.0
        points = np.stack(np.meshgrid(cells, 0.5 * cells - 1.0), axis=2).reshape(-1, 2)
        rest = solved(body, source)
        found = [body.model.values_along(points, np.tile(one, (len(points), 1))) @ rest for one in np.eye(2)]
        field = forces.displacement(near_field.as_complex(points))
        whole = np.stack(found, axis=1) + np.moveaxis(field, 1, 3).reshape(len(points), 2, 4)
        patterns = body.free.patterns(points).reshape(len(points), 2, -1)
        mean = (
            np.einsum("ecd,eck->dk", patterns, whole) / np.einsum("ecd,ecd->d", patterns, patterns)[:, None]
        )
        assert np.abs(mean).max() <= 5e-3 * np.abs(whole).max()
        # Functionals, which are found without the solutions, have it too.
        rows = body.model.values_along(points[:3], np.tile([1.0, 0.0], (3, 1)))
        assert body.system.functionals(rows, sparse.csc_array(source)) == pytest.approx(
            rows @ rest, abs=1e-9 * np.abs(rest).max()
        )
