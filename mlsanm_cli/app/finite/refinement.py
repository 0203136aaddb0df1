"""Automatic refinement of contacts at finite strain from the patches of a first run.

Pressures are nodal, and places and widths of the patches are known from a run only. Runs are repeated with
finer nodes until all patches have the nodes required for the accuracy of their contacts, at most ``MAX_RUNS``
times. Only contacts between bodies with automatic spacings are refined.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.patches import Touched, wanted_spacings
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.app.scene.clouds import line_of
from mlsanm_cli.app.scene.contact_spacing import NODAL_BAND, NODAL_GROWTH
from mlsanm_cli.app.scene.refinement import Refinement, has_automatic_spacings
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Curve, Segment
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.finite.update import AnyContact
from mlsanm_cli.errors import CaseError, NumericalError

MAX_RUNS = 4
"""Largest number of repeated runs."""
FORCE_ERROR = 0.2
"""Error of a contact's force times the square of its number of nodes, as its ends are known to its nodes."""
MAX_NODES, COARSENING = 5000, 1.5
"""Largest number of nodes of a refined scene, and the factor by which spacings are increased until it has no
more."""


def refined(
    case: Case,
    scene: FiniteScene | None,
    touched: Touched,
    known: Refinement,
    failure: NumericalError | None,
    context: RunContext,
) -> tuple[Refinement, SceneModel] | None:
    """Refinement and clouds of the next run, None if the last one is final; ``scene`` is None if a
    ``failure`` came before it."""
    if known.failed:
        return None
    if failure and known.passes and known.passes[-1]["done"]:
        back = Refinement(known.before, passes=known.passes[:-1], failed=failure.message)
        return back, place(Boundaries.of(case), context, back.zones)
    if scene is None:
        return None
    nodes = scene.unknowns // 2
    figures = {key: {name: one[key] for name, one in touched.items()} for key in ("across", "forces")}
    now: dict[str, Any] = {"nodes": nodes, "done": failure is None, **figures}
    passes = (*known.passes, now)
    zones = wanted_zones(scene, touched) if len(passes) <= MAX_RUNS else ()
    fewer = False
    while zones:
        found = Refinement(zones, passes, before=known.zones, fewer=fewer)
        try:
            finer = place(Boundaries.of(case), context, zones)
        except (NumericalError, CaseError):
            return None
        count = sum(len(model.cloud.points) for model in finer.models.values())
        before = (
            (scene.bodies[name].elastic.model.cloud.points, one.cloud.points)
            for name, one in finer.models.items()
        )
        if all(np.array_equal(*nodes) for nodes in before):
            return None
        if count <= MAX_NODES:
            return found, finer
        if fewer and nodes > MAX_NODES:
            return None
        fewer = True
        zones = tuple(_zone(one.curve, COARSENING * one.spacing) for one in zones)
    return None


def wanted_zones(scene: FiniteScene, touched: Touched) -> tuple[Zone, ...]:
    """Zones required by the contacts, none if all have enough nodes."""
    own = [contact for contact in scene.contacts.pairs if is_automatic(scene.case, contact)]
    if not any(touched[contact.name]["coarse"] for contact in own if contact.name in touched):
        return ()
    found = np.zeros((0, 5))
    for contact in own:
        for side, spacing in zip(contact.sides, wanted_spacings(touched[contact.name]), strict=True):
            found = np.vstack([found, _segments(side, spacing)])
    line = line_of(Boundaries.of(scene.case))
    if line is not None:
        image = np.hstack([line.reflect(found[:, :2]), line.reflect(found[:, 2:4]), found[:, 4:]])
        found = np.vstack([found, image])
    return tuple(_zone(Segment((a, b), (c, d)), spacing) for a, b, c, d, spacing in found.tolist())


def _zone(curve: Curve, spacing: float) -> Zone:
    return Zone(curve, spacing, NODAL_BAND * spacing, NODAL_GROWTH)


def is_automatic(case: Case, contact: AnyContact) -> bool:
    """Whether the spacings of all bodies of a contact are automatic."""
    return has_automatic_spacings(case, {side.body for side in contact.sides})


def _segments(side: ContactSide, spacing: FloatArray) -> FloatArray:
    """Rows (k, 5) of the segments between nodes with finite ``spacing`` (c,): ends and the finer spacing."""
    one = np.arange(side.count if side.around is not None else side.count - 1)
    other = (one + 1) % side.count
    finer = np.minimum(spacing[one], spacing[other])
    rows = np.column_stack([side.places[one], side.places[other], finer])
    return rows[np.isfinite(spacing[one]) & np.isfinite(spacing[other])]


def contact_errors(known: Refinement, touched: Touched) -> dict[str, float]:
    """Estimated error of the force of each contact over the largest force: the larger of the error expected
    from its number of nodes and that extrapolated from the change since the previous run."""
    size = max((math.hypot(*f) for one in touched.values() for f in one["forces"].values()), default=0.0)
    found = {}
    before = known.passes[-1] if known.passes else {"across": {}}
    for name, own in touched.items():
        across, fewer = own["across"], before["across"].get(name)
        if across is None:
            continue
        found[name] = FORCE_ERROR / across**2
        if fewer is None or not size:
            continue
        ratio = (fewer / across) ** 2
        changes = [
            math.dist(force, before["forces"][name][at]) / size
            for at, force in own["forces"].items()
            if at in before["forces"].get(name, {})
        ]
        if ratio < 1.0 and changes:
            found[name] = max(found[name], max(changes) * ratio / (1.0 - ratio))
    return found
