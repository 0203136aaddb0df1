"""Corners: what keeps both faces of a wedge free of tractions, and behind walls images."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Segment
from mlsanm_cli.mechanics.corner import Corner, CorneredForces
from mlsanm_cli.mechanics.corner_faces import Face
from mlsanm_cli.mechanics.material import isotropic, orthotropic
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField, SurfaceForces, kernel_of, traction
from mlsanm_cli.mechanics.wedge import STEP, Wedge

WOOD = kernel_of(orthotropic((12.0, 0.6, 0.6), (0.4, 0.4, 0.3), 0.7, 0.5, "strain"))
STEEL = kernel_of(isotropic(1.0, 0.3, "strain"))
SOURCES = np.array([0.05, 0.3, 1.0])


def corner(kernel: PointForceField, angle: float, sliding: bool = False) -> Corner:
    """A corner at the origin, its first face along x, with material below."""
    other = complex(np.exp(-1j * np.radians(angle)))
    return Corner(Wedge(kernel, 1.0 + 0.0j, other, -1j, sliding), 0.0j, 1.0, 1.0)


def forces(at: Corner) -> CorneredForces:
    places = SOURCES * at.wedge.along
    return CorneredForces(SurfaceForces(at.wedge.kernel, places, np.full(3, -1j)), (at,))


def stress_of(at: Corner, z: ComplexArray) -> FloatArray:
    """Stresses (e, 3, 3, 2), points and forces first, of unit forces at the sources and the densities that
    they cause along the faces."""
    stress = forces(at).own.stress(z)
    for line in at.face_forces(SOURCES, np.eye(6).reshape(3, 2, 6)):
        stress = stress + np.moveaxis(line.stress(z).reshape(len(z), 3, 3, 2), 2, 1)
    return stress


@pytest.mark.parametrize(
    ("kernel", "angle"),
    [
        *((STEEL, angle) for angle in (35.0, 60.0, 90.0, 140.0, 214.0, 255.0, 270.0)),
        (WOOD, 90.0),
        (WOOD, 214.0),
    ],
)
def test_both_faces_are_free(kernel: PointForceField, angle: float) -> None:
    at, x = corner(kernel, angle), np.array([0.02, 0.15, 0.7, 3.0])
    for face in at.faces:
        z = x * face.along + 1e-6 * x * face.inward
        found = traction(stress_of(at, z), np.full((4, 1), -face.inward))
        assert np.abs(found * x[:, None, None, None]).max() < (2e-3 if kernel is STEEL else 2e-2)
    # A force here moves there as one there does here: what is added to the two half-planes, too.
    for component in (0, 1):
        table = at.wedge.compliance(SOURCES, SOURCES, component, component)
        assert table == pytest.approx(table.T, abs=1e-5 * np.abs(table).max())


def test_a_side_parallel_to_a_face_is_not_part_of_it() -> None:
    """The web of a tee is parallel to the second face of its flange's corner."""
    at = forces(corner(STEEL, 90.0))
    z = np.array([1.0 - 0.4j, 1.0 - 2.0j])
    normal, flat = np.full(2, -1.0 + 0.0j), np.zeros(2)
    expected = traction(stress_of(at.corners[0], z), normal[:, None])
    assert at.traction(z, normal, flat) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kernel", [STEEL, WOOD])
@pytest.mark.parametrize("angle", [45.0, 90.0, 150.0, 180.0, 214.0])
def test_a_clamped_face_moves_as_one(kernel: PointForceField, angle: float) -> None:
    """No deformation along it, nothing left of all forces together, and no traction on the other face."""
    other, x = complex(np.exp(-1j * np.radians(angle))), np.array([1e-3, 0.02, 0.15, 0.7, 3.0])
    at = Corner(Wedge(kernel, 1.0 + 0.0j, other, -1j, clamped=True), 0.0j, 1.0, 1.0)
    moved, alone = forces(at).displacement(x * other), forces(at).own.displacement(x * other)
    assert np.abs(moved - moved[0]).max() < 1e-3 * np.ptp(alone)
    own, beyond = at.wedge.densities
    total = STEP * (own + beyond).sum(axis=0)
    assert total == pytest.approx(-np.eye(2), abs=1e-6)
    z = x[1:] - 1e-6j * x[1:]
    found = traction(stress_of(at, z), np.full((4, 1), 1j))
    assert np.abs(found * x[1:, None, None, None]).max() < 2e-3
    table = at.wedge.compliance(SOURCES, SOURCES, 1, 1)
    assert table == pytest.approx(table.T, abs=1e-5 * np.abs(table).max())


@pytest.mark.parametrize(("angle", "sliding"), [(90.0, False), (214.0, False), (70.0, True), (110.0, True)])
def test_compliance_is_what_the_lines_move(angle: float, sliding: bool) -> None:
    at = corner(STEEL, angle, sliding)
    x = np.array([0.02, 0.2, 0.8])
    force = np.zeros((3, 2, 3))
    force[np.arange(3), 1, np.arange(3)] = 1.0
    moved = np.zeros((3, 2, 3))
    for source in at.sources(SOURCES, force):
        moved += source.displacement(x - 1e-9j)
    expected = at.wedge.compliance(x, SOURCES, 1, 1)

    def apart(values: FloatArray) -> FloatArray:
        return np.asarray(values - values[:1])

    # Rigid motions apart.
    assert apart(moved[:, 1]) == pytest.approx(apart(expected), abs=2e-3 * np.ptp(expected))


@pytest.mark.parametrize("angle", [30.0, 60.0, 90.0, 120.0])
def test_a_wall_at_any_angle_keeps_its_face(angle: float) -> None:
    """No displacement across the wall, no traction along it, and none on the first face."""
    at, x = corner(STEEL, angle, sliding=True), np.array([0.02, 0.3, 2.0])
    across = 1j * at.wedge.other
    unit = np.array([across.real, across.imag])
    moved = np.einsum("ekcd,c->ekd", forces(at).displacement(x * at.wedge.other), unit)
    apart = np.einsum("ekcd,c->ekd", forces(at).own.displacement(x * at.wedge.other), unit)
    assert np.abs(moved - moved[:1]).max() < 2e-4 * np.ptp(apart)
    normal = np.full(3, across)
    along = np.array([at.wedge.other.real, at.wedge.other.imag])
    pulled = forces(at).traction(x * at.wedge.other, normal, np.zeros(3))
    alone = forces(at).own.traction(x * at.wedge.other, normal, np.zeros(3))
    assert np.abs(np.einsum("ekcd,c->ekd", pulled, along)).max() < 1e-3 * np.abs(alone).max()
    table = at.wedge.compliance(SOURCES, SOURCES, 1, 1)
    assert table == pytest.approx(table.T, abs=1e-5 * np.abs(table).max())


def limited(angle: float, bent: float = 0.0, center: complex | None = None) -> Corner:
    """A corner at the origin with fields along its faces alone: the first one along x with material above, of
    curvature ``bent``, the second one straight."""
    other = complex(np.exp(1j * np.radians(angle)))
    first: Curve = Segment((0.0, 0.0), (2.0, 0.0))
    if bent:
        turn = -0.5 * np.pi if bent > 0.0 else 0.5 * np.pi
        first = Arc((0.0, 1.0 / bent), abs(1.0 / bent), turn, float(2.0 * bent))
    second = Segment((2.0 * other.real, 2.0 * other.imag), (0.0, 0.0))
    wedge = Wedge(STEEL, 1.0 + 0.0j, other, 1j)
    faces = Face(0.0j, 1.0 + 0.0j, 1j, first), Face(0.0j, other, wedge.inward[1], second, at_end=True)
    return Corner(wedge, 0.0j, 2.0, 1.0, faces, 1.5, center)


@pytest.mark.parametrize(
    ("angle", "bent", "center"),
    [(60.0, 0.0, None), (90.0, 0.0, None), (270.0, 0.0, 0.5 - 0.5j), (75.0, 0.2, None), (110.0, -0.2, None)],
)
def test_tractions_left_by_limited_fields_change_little(
    angle: float, bent: float, center: complex | None
) -> None:
    """Next to a force the first and the second face have tractions like its distance from the tip; what is
    left is like the span's, and on straight faces the same all the way to the tip."""
    at = limited(angle, bent, center)
    source, inward = at.faces[0].places(np.array([0.003, 0.03]))
    found = CorneredForces(SurfaceForces(STEEL, source, inward, center), (at,))
    x = np.array([0.0, 3e-4, 3e-3, 0.03])
    for face in at.faces:
        place, inward = face.places(x)
        curvature = np.full(len(x), 0.0 if face.at_end else bent)
        left = found.traction(place, -inward, curvature)
        assert np.abs(left).max() < 1.5
        if not bent:
            assert np.abs(left - left[1]).max() < 0.1 * max(np.abs(left).max(), 0.5)


@pytest.mark.parametrize("angle", [60.0, 90.0, 270.0])
def test_limited_fields_move_the_face_as_whole_ones_near_the_tip(angle: float) -> None:
    at = limited(angle)
    away = at.beyond_wedge(np.array([2e-4, 1e-3, 5e-3]) + 0.0j)
    whole = np.ptp(at.wedge.compliance(SOURCES, SOURCES, 1, 1))
    # Rigid motions apart, of which the rotation is small so near the tip.
    assert np.abs(away - away[:1]).max() < 2e-2 * whole
    far = at.beyond_wedge(np.array([0.2, 0.6, 1.4]) + 0.0j)
    assert np.abs(far - far[:1]).max() > 5e-2 * whole
