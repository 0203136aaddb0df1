"""Equilibrium of a body's pieces: fluxes and loads balance, thin bodies bend as they should."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sparse

from benchmarks import thin_bodies
from benchmarks.formulas import KirschHole
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, GAUSS, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import annulus, disk, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.pieces import Pieces, StressAround
from mlsanm_cli.mechanics.rigid import FreeSystem
from mlsanm_cli.mechanics.supports import Springs
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.operators.system import residual_of
from tests.mechanics.bodies import (
    STEEL,
    boundary_values,
    build,
    jittered_square,
    polygon,
    solved,
    with_body_force,
)

SOFT = isotropic(1.0, 0.3, "stress")
Field = Callable[[FloatArray], FloatArray]
HELDS: list[dict[str, tuple[bool, bool]]] = [
    {},
    {"bottom": (True, True)},
    {"bottom": (False, True), "left": (True, False)},
]


def of_edges(stress: Field) -> StressAround:
    """A stress (n, 3) of places as pieces ask for it, by places (e, t, 2): (3 e t,)."""
    return lambda _, points: stress(points.reshape(-1, 2)).T.ravel()


def uniform(at: FloatArray) -> FloatArray:
    """An even stress."""
    return np.tile([3.0, -2.0, 0.7], (len(at), 1))


def linear(at: FloatArray) -> FloatArray:
    """A stress linear in place, out of balance."""
    slopes = np.array([[1.0, -0.4, 0.3], [0.6, 2.0, -1.1]])
    return np.asarray(uniform(at) + at @ slopes)


def linear_force(at: FloatArray) -> FloatArray:
    """The body force that keeps it in equilibrium."""
    return np.tile([-(1.0 - 1.1), -(0.3 + 2.0)], (len(at), 1))


@pytest.mark.parametrize("held", HELDS)
@pytest.mark.parametrize("touching", [(), ("top",)], ids=["", "pairs"])
def test_fluxes_of_even_and_linear_stress_balance_on_every_piece(
    held: dict[str, tuple[bool, bool]], touching: tuple[str, ...]
) -> None:
    cloud = build_cloud(
        rectangle((0.0, 1.5), (0.0, 1.0)), Spacing(0.05, (Zone.around((0.2, 1.0), 0.02, 0.1, 0.12),)), 0
    )
    model = BodyModel.build("body", cloud, STEEL, MlsSettings(2))
    body = assemble(model, held, (), "auto", touching=touching)
    assert body.pieces.main.sum() < body.pieces.count if touching else body.pieces.main.all()
    for stress in (uniform, linear):
        source = boundary_values(body, lambda at: 0.0 * at, stress)
        if stress is linear:
            source = with_body_force(body, source, linear_force)
        out, loads = (body.pieces.fluxes(of_edges(stress), body.restrained, GAUSS[2]), body.loads @ source)
        assert np.abs(out).max() > 1e-2
        np.testing.assert_allclose(loads, out, rtol=0.0, atol=1e-12)


def pressed(body: ElasticBody, name: str, pressure: float) -> FloatArray:
    """Right-hand side (r,) of an even pressure on a surface."""
    surface = body.model.cloud.surfaces[name]
    between = -pressure * surface.curve.normals(Halves.of(surface, FINE).arc)
    return body.source(name, -pressure * surface.normal, held=False, between=between)


def test_loads_of_an_even_pressure_and_of_body_forces_have_exact_totals() -> None:
    cloud = build_cloud(disk((0.3, -0.2), 1.0), Spacing(0.1), 0)
    body = build(cloud, {})
    (name,) = cloud.surfaces
    # A pressure all around has no resultant, on half a disk the force on its diameter.
    center = (0.7, 0.4)
    assert body.resultants(center) @ pressed(body, name, 2.5) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    weight = body.force_source(np.tile([0.0, -9.81], (len(cloud.points), 1)))
    force = 9.81 * np.pi
    assert body.resultants(center) @ weight == pytest.approx([0.0, -force, force * (0.7 - 0.3)], rel=1e-5)
    # Body forces that turn: their moment is the polar moment of area.
    arm = cloud.points - np.array([0.3, -0.2])
    turning = body.force_source(np.stack([-arm[:, 1], arm[:, 0]], axis=1))
    assert body.resultants((0.3, -0.2)) @ turning == pytest.approx([0.0, 0.0, 0.5 * np.pi], abs=1e-2)


def test_loads_on_a_polygon_have_exact_totals() -> None:
    cloud = build_cloud(rectangle((0.0, 2.0), (0.0, 1.0)), Spacing(0.1), 0)
    body = build(cloud, {})
    x, y = cloud.points.T
    source = body.force_source(np.stack([1.0 + x - y, x], axis=1))
    # int (1 + x - y) = 3, int x = 2, int (x x - y (1 + x - y)) = 8/3 - (1 + 1 - 2/3).
    assert body.resultants() @ source == pytest.approx([3.0, 2.0, 4.0 / 3.0], rel=1e-12)
    top = cloud.surfaces["top"]
    shear = np.stack([1.0 + cloud.points[top.index, 0], np.zeros(len(top.index))], axis=1)
    assert body.resultants((0.0, 0.5)) @ body.source("top", shear, held=False) == pytest.approx([4, 0, -2])


@pytest.mark.parametrize("name", ["outer", "inner"])
def test_without_values_between_the_nodes_a_pressure_is_turned_along_the_outline(name: str) -> None:
    cloud = build_cloud(annulus((0.0, 0.0), (0.5, 1.0)), Spacing(0.1), 0)
    body = build(cloud, {})
    exact = body.loads @ pressed(body, name, 1.0)
    source = body.source(name, -cloud.surfaces[name].normal, held=False)
    assert np.abs(body.loads @ source - exact).max() <= 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("held", HELDS)
def test_reactions_balance_all_loads(held: dict[str, tuple[bool, bool]]) -> None:
    # What the pieces add up to holds exactly.
    body = build(jittered_square(21), held)
    cloud = body.model.cloud
    source = body.force_source(np.stack([np.sin(cloud.points[:, 1]), cloud.points[:, 0]], axis=1))
    pull = np.stack([np.ones(21), np.linspace(-1.0, 2.0, 21)], axis=1)
    source += body.source("right", pull, held=False)
    reactions = np.zeros(3)
    u = solved(body, source)
    for name in held:
        reactions += body.reaction_rows(name) @ u.ravel()
    loads = body.resultants() @ source
    if held:
        assert reactions == pytest.approx(-loads, rel=1e-9)
    else:
        # Nothing holds: inertia balances what there is.
        assert isinstance(body.system, FreeSystem)
        assert np.abs(loads).max() > 0.5
        balanced = source + body.system.balance @ (body.system.work @ source)
        assert np.abs(body.resultants() @ balanced).max() <= 1e-12


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_a_slender_clamped_beam_bends_as_it_should(degree: int, seed: int) -> None:
    """Work of a unit shear force at the end of 20 x 1, against finite elements of degree 19."""
    cloud = build_cloud(rectangle((0.0, 20.0), (-0.5, 0.5)), Spacing(0.25), seed)
    body, end = build(cloud, {"left": (True, True)}, degree, SOFT), cloud.surfaces["right"]
    u = solved(body, body.source("right", np.tile([0.0, 1.0], (len(end.index), 1)), held=False))
    assert np.trapezoid(u[end.index, 1], end.arc_length) == pytest.approx(32034.2, rel=0.01)


@pytest.mark.parametrize(
    ("name", "degree", "off"),
    # The portal's fillets have two spacings.
    [("ring 20", 2, 0.002), ("ring 10", 4, 0.002), ("portal", 2, 0.015), ("portal", 4, 0.015)],
)
def test_a_thin_body_bends_as_it_should(name: str, degree: int, off: float) -> None:
    body = thin_bodies.portal() if name == "portal" else thin_bodies.ring(int(name.split()[1]))
    work, energy_error = thin_bodies.solved(body, 5, degree)
    assert work == pytest.approx(thin_bodies.REFERENCES[name], rel=off)
    assert abs(energy_error) <= 2.0 * max(off, 0.005)


def test_a_long_thin_arch_is_solved_and_not_told_to_be_solved_badly() -> None:
    # Its factor loses the softest ways of bending to round-off, and its sums of equilibrium move the solution
    # by a thousandth, which is no error.
    radius, angle = 60.0, 5.0 / 3.0 * np.pi
    cloud = build_cloud(sector((0.0, 0.0), (radius - 0.5, radius + 0.5), (0.0, angle)), Spacing(1.0 / 3.0), 0)
    body = build(cloud, {"start": (True, True)}, 2, SOFT)
    push = np.tile([0.0, 1e-9], (len(cloud.surfaces["end"].index), 1))
    source = body.source("end", push, held=False)
    found = solved(body, source)
    assert residual_of(body.system, sparse.csc_array(source[:, None]), found.reshape(-1, 1)) <= 1e-6
    # Bent by the moments F R (cos phi - cos angle) of a force F along y at its end.
    moved = found[cloud.surfaces["end"].index, 1].mean()
    c, s = np.cos(angle), np.sin(angle)
    assert moved == pytest.approx(12e-9 * radius**3 * ((0.5 + c * c) * angle - 1.5 * c * s), rel=2e-3)


def test_a_hole_in_a_coarse_structured_mesh_keeps_its_peak() -> None:
    # Cells 1.6 times as deep as wide, 48 around it.
    around, radii = 48, 1.21 ** np.arange(9)
    outline, surfaces = annulus((0.0, 0.0), (1.0, radii[-1])), {}
    angle = 2.0 * np.pi * np.arange(around) / around
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1) for r in radii]
    for name, curve in zip(outline.names, outline.curves, strict=True):
        ring = 0 if name == "inner" else len(radii) - 1
        s = curve.closest(rings[ring])
        order = np.argsort(s)
        index = ring * around + order
        surfaces[name] = Surface(name, curve, index, s[order], curve.normals(s[order]))
    spacing = np.repeat(radii * np.sqrt(0.21 * 2.0 * np.pi / around), around)
    body = build(Cloud(np.concatenate(rings), spacing, surfaces), {}, 2, SOFT)
    moved = solved(body, boundary_values(body, lambda at: 0.0 * at, KirschHole(1.0, 1.0).stress))
    peaks = body.model.stress(moved)[[around // 4, 3 * around // 4], 0]
    assert peaks == pytest.approx([3.0, 3.0], rel=0.04)


def sprung(springs: Springs) -> ElasticBody:
    """A block that nothing but springs hold."""
    cloud = build_cloud(rectangle((0.0, 2.0), (0.0, 1.0)), Spacing(0.1), 0)
    model = BodyModel.build("body", cloud, STEEL, MlsSettings(2))
    return assemble(model, {}, (), "auto", springs)


@pytest.mark.parametrize("stiffness", [1e-3, 1e-2, 1.0])
def test_a_block_on_springs_alone_moves_by_force_over_stiffness(stiffness: float) -> None:
    # Springs that are soft against the block: it moves as a whole, 2 wide, and hardly changes its shape.
    body = sprung({"bottom": (stiffness, 3.0 * stiffness)})
    assert body.soft_springs
    pull = 1e-3 * stiffness * np.array([1.0, -6.0])
    source = body.force_source(np.tile(pull, (len(body.model.cloud.points), 1)))
    u = solved(body, source)
    # The pull in x, 1/2 above the springs, turns the block about their middle: k_y L^3 / 12 per angle.
    turn = -0.5 * pull[0] * 2.0 / (3.0 * stiffness * 8.0 / 12.0)
    x, y = body.model.cloud.points.T
    expected = np.stack(
        [pull[0] / stiffness - turn * y, pull[1] / (3.0 * stiffness) + turn * (x - 1.0)], axis=1
    )
    assert np.abs(u - expected).max() <= 0.01 * stiffness * np.abs(expected).max()


def test_stiff_springs_hold_by_the_stress_inside() -> None:
    body = sprung({"bottom": (1e4, 1e4)})
    assert not body.soft_springs
    assert body.restrained == {"bottom": (True, True)}
    weight = body.force_source(np.tile([0.0, -1.0], (len(body.model.cloud.points), 1)))
    u = solved(body, weight)
    assert body.reaction_rows("bottom", (1.0, 0.0)) @ u.ravel() == pytest.approx([0.0, 2.0, 0.0], abs=2e-3)


def test_a_node_at_the_root_of_a_narrow_slit_is_in_a_piece_with_an_area() -> None:
    x, y = (0.0, 6.0, 6.0, 1.0, 1.0, 6.0, 6.0, 0.0), (0.0, 0.0, 1.0, 1.0, 1.1, 1.1, 2.15, 2.15)
    clip = polygon(list(zip(x, y, strict=True)))
    cloud = build_cloud(clip, Spacing(0.25), 0)
    # It is a corner of no triangle.
    assert (cloud.areas == 0.0).any()
    assert Pieces(cloud).size.min() > 0.0
