"""Fields under the pressures of a contact grid: of what is loaded, wherever that is."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.obstacles import Plane
from mlsanm_cli.contact.response import contact_fields
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.mechanics.near_field import Isotropic, SurfaceForces, as_complex

KERNEL = Isotropic(1.0, 1.8)
# The top of a block, from right to left: the arc length s is at x = 2 - s.
TOP = Facing(Segment((2.0, 0.0), (-2.0, 0.0)), None, Plane((0.0, 0.0), (0.0, -1.0)))
NODES = 1.0 + 2.0 * np.linspace(0.0, 1.0, 160) ** 1.3
GRID = ContactGrid(TOP, 1.0, 3.0, 12, Hats(NODES))
BELOW = as_complex(
    np.array([[x, -y] for y in (0.0, 1e-3, 0.02, 0.3, 4.0) for x in (-0.99, -0.31, 0.0, 0.68, 1.9)])
)


def fields(pressure: FloatArray, traction: FloatArray, contacts: int = 1) -> FloatArray:
    """Displacements and stresses (e, 5) below the grid."""
    found = NearFields.at(GRID, KERNEL, True, BELOW, contacts)(pressure[:, None], traction[:, None])
    return np.concatenate(found, axis=1)[..., 0]


def test_fields_of_parts_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    pressure, traction = rng.random(len(GRID.hats.place)), rng.random(len(GRID.hats.place))
    part = np.arange(len(pressure)) // 7 % 3
    whole = fields(pressure, traction)
    parts = sum(
        fields(np.where(part == k, pressure, 0.0), np.where(part == k, traction, 0.0)) for k in range(3)
    )
    assert np.abs(parts - whole).max() <= 1e-6 * np.abs(whole).max()
    assert not fields(0.0 * pressure, 0.0 * traction).any()
    # With many contacts nothing is kept, and few points are treated at once.
    monkeypatch.setattr(contact_fields, "BATCH_SIZE", 300)
    assert fields(pressure, traction, 10**9) == pytest.approx(whole, abs=1e-13 * np.abs(whole).max())


@pytest.mark.parametrize("node", [0, 80, 157])
def test_one_hat_loads_both_its_intervals(node: int) -> None:
    one = np.zeros(len(GRID.hats.place))
    one[node] = 1.0
    at, weight = np.polynomial.legendre.leggauss(60)
    starts, steps = NODES[node : node + 2], GRID.hats.steps[node : node + 2]
    share = 0.5 * (1.0 + at)
    s = (starts + share[:, None] * steps).ravel()
    rise = np.stack([share, 1.0 - share], axis=1).ravel()
    size = (0.5 * weight[:, None] * steps).ravel() * rise
    sources = SurfaceForces(KERNEL, (2.0 - s).astype(complex), np.full(len(s), -1j))
    deep = BELOW.imag < -0.01
    # Pressures push the block down.
    stress = (sources.stress(BELOW[deep])[..., 1] * -size[:, None]).sum(axis=1)
    # Grids are made for pressures that change little from interval to interval: three points each do then.
    assert fields(one, 0.0 * one)[deep, 2:] == pytest.approx(stress, abs=1e-3 * np.abs(stress).max())
