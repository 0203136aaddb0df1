"""Corners: what keeps both faces of a wedge free of tractions, and behind walls images."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.corner import Corner, CorneredForces, Mirror
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.near_field import Kernel, SurfaceForces, kernel_of, traction
from mlsanm_cli.mechanics.wedge import Wedge

STEEL = kernel_of(isotropic(1.0, 0.3, "strain"))
SOURCES = np.array([0.05, 0.3, 1.0])


def corner(kernel: Kernel, angle: float) -> Corner:
    """A corner at the origin, its first face along x, with material below."""
    return Corner(Wedge(kernel, 1.0 + 0.0j, complex(np.exp(-1j * np.radians(angle)))), 0.0j, 1.0, 1.0)


def forces(at: Corner) -> CorneredForces:
    places = SOURCES * at.wedge.along
    return CorneredForces(SurfaceForces(at.wedge.kernel, places, np.full(3, -1j)), (at,))


@pytest.mark.parametrize("angle", [35.0, 60.0, 90.0, 140.0])
def test_both_faces_are_free(angle: float) -> None:
    at, kernel = corner(STEEL, angle), STEEL
    assert isinstance(at.wedge, Wedge)
    force = np.eye(6).reshape(3, 2, 6)
    x = np.array([0.02, 0.15, 0.7, 3.0])
    size = []
    for face, inward in zip(at.faces, at.wedge.inward, strict=True):
        z = x * face + 1e-6 * x * inward
        stress = sum((line.stress(z) for line in at.lines(SOURCES, force)), start=np.zeros((4, 3, 6)))
        own = kernel.stress(z[:, None] - SOURCES)
        stress = stress + np.moveaxis(own, 2, 1).reshape(4, 3, 6)
        found = traction(stress.reshape(4, 3, 3, 2).transpose(0, 2, 1, 3), np.full((4, 1), -inward))
        size.append(np.abs(found * x[:, None, None, None]).max())
    assert max(size) < 2e-3
    # Without the corner's forces the other face is anything but free.
    alone = traction(kernel.stress(at.faces[1] * x[:, None] - SOURCES), np.full((4, 1), -at.wedge.inward[1]))
    assert np.abs(alone * x[:, None, None, None]).max() > 0.05


def test_reciprocity() -> None:
    """A force here moves there as one there does here: what is added to the two half-planes, too."""
    at = corner(STEEL, 90.0)
    for component in (0, 1):
        table = at.wedge.compliance(SOURCES, SOURCES, component, component)
        assert table == pytest.approx(table.T, abs=1e-5 * np.abs(table).max())


def test_compliance_is_what_the_lines_move() -> None:
    at = corner(STEEL, 90.0)
    assert isinstance(at.wedge, Wedge)
    x = np.array([0.02, 0.2, 0.8])
    force = np.zeros((3, 2, 3))
    force[np.arange(3), 1, np.arange(3)] = 1.0
    moved = sum(
        (line.displacement(x - 1e-9j) for line in at.lines(SOURCES, force)), start=np.zeros((3, 2, 3))
    )
    expected = at.wedge.compliance(x, SOURCES, 1, 1)

    def apart(values: FloatArray) -> FloatArray:
        return np.asarray(values - values[:1])

    # Rigid motions apart.
    assert apart(moved[:, 1]) == pytest.approx(apart(expected), abs=2e-3 * np.ptp(expected))


def test_images_keep_a_wall() -> None:
    wall = Corner(Mirror(STEEL, 1.0 + 0.0j, -1j), 0.0j, 1.0, 1.0)
    place = -1j * np.array([0.01, 0.3, 2.0])
    moved = forces(wall).displacement(place)
    assert np.abs(moved[:, :, 0]).max() < 1e-12
    normal = np.full(3, -1.0 + 0.0j)
    assert np.abs(forces(wall).traction(place, normal, np.zeros(3))[:, :, 1]).max() < 1e-9
