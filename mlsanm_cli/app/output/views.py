"""The points at which fields are written: the nodes and, under contact grids, points as fine as the grids,
where fields are a smooth remainder and a closed form. The largest stress lies a part of the contact's width
below the surface, where the cloud may have no node."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.arrays import runs_of
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.spacing import Zone, build_cloud
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import named_fields
from mlsanm_cli.solve.state import Fields, State

PER_HALF_WIDTH = 12.0
"""Points over the half-width of a contact patch."""
FINE_RADIUS, GROWTH = 1.5, 0.25
"""Radius of the fine zone in half-widths, and growth of the spacing beyond it."""
MAX_PATCHES = 12
"""Largest number of patches of a contact with fine points, the widest first."""
MIN_REFINEMENT = 0.7
"""Zones whose spacing is above this part of that of the cloud are omitted."""


@dataclass(frozen=True)
class View:
    """The points of a ``cloud`` at which the fields of a body of a ``model`` are written."""

    model: BodyModel
    cloud: Cloud

    @cached_property
    def rows(self) -> sparse.csr_array:
        """Displacement x and y and stresses xx, yy, xy at the points (5e, 2N), quantity by quantity."""
        return self.model.probe_rows(self.cloud.points)

    @cached_property
    def values(self) -> sparse.csr_array:
        """A nodal field at the points (e, n)."""
        return self.model.field_rows(self.cloud.points)


def finer_views(built: CondensedScene, boundaries: Boundaries, memo: Memo = NO_CACHE) -> dict[str, View]:
    """Finer points for bodies whose clouds are too coarse for their contact patches at the ends of stages.
    Scenes with the same patches share them by the ``memo``."""
    condensed, finer = built.condensed, {}
    for body in (body for body in built.case.body if not body.has_nodes):
        model, zones = built.scene.bodies[body.name].model, list[Zone]()
        for pairing in (one for one in condensed.on_grids if body.name in one.bodies):
            closed = np.any([state.closed[condensed.spans[pairing.name]] for state in built.ends], axis=0)
            # A hat ends at the node beyond the one after it.
            patches = pairing.grid.hats.nodes[runs_of(closed) + np.array([0, 1])]
            patches = patches[np.argsort(patches[:, 0] - patches[:, 1], kind="stable")][:MAX_PATCHES]
            for slave in (slave for owner, slave, _ in pairing.sides if owner == body.name):
                for first, last in patches.tolist():
                    half, s = 0.5 * (last - first), np.array([0.5 * (first + last)])
                    middle = pairing.grid.facing.side(s, slave)[0][0]
                    point = (float(middle.real), float(middle.imag))
                    nearest = min(model.cloud.tree.query(point)[1], len(model.cloud.points) - 1)
                    if half / PER_HALF_WIDTH < MIN_REFINEMENT * model.cloud.spacing[nearest]:
                        zones.append(Zone.around(point, half / PER_HALF_WIDTH, FINE_RADIUS * half, GROWTH))
        if zones:
            spacing = spacing_of(boundaries, body).with_zones(tuple(zones))
            cloud = build_cloud(boundaries.outline(body.name), spacing, body.seed, memo=memo)
            finer[body.name] = memo.value("view", (model, cloud), partial(View, model, cloud))
    return finer


def shown_fields(
    built: CondensedScene, views: Mapping[str, View], state: State, fields: Mapping[str, Fields], stress: bool
) -> dict[str, Fields]:
    """The fields at the points where they are written, with stresses if requested."""
    shown = dict(fields)
    for name, view in views.items():
        points = view.cloud.points
        moved, stressed = built.condensed.contact_fields(built.scene, name, state.unknowns, points)
        seen = (view.rows @ fields[name]["rest"].ravel()).reshape(-1, len(points)).T
        sigma = seen[:, 2:] + stressed if stress else stressed[:0]
        at = seen[:, :2] + moved, sigma, points, view.values
        shown[name] = named_fields(built, name, state, *at)
    return shown
