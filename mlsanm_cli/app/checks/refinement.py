"""``[adapt] passes``: solve, refine at contact edges and where fits are poor, solve again.

The regularised law, bodies of revolution and plastic strains have nodal pressures or strains: automatic
spacings of bodies in contact are refined to ``NODAL_RULE`` or ``RING_RULE`` without being asked.

Edges of contact are known to half a spacing. Every pass requires the spacings of a ``Rule`` under each patch
and around its edges, within twice their uncertainty, then around the edges of stick zones, on both bodies.

If the bodies limit the accuracy, and without contact, the bulk is refined where local fits are poor, and
these zones are kept. The residual r of a node is the difference between the stress of fits of the next degree
and that of the solution. With a uniform spacing h it grows like h^degree; the sum of (r h)^2 is least for a
given number of nodes if r h is uniform: the required spacing is h (level / (r h))^(1 / (degree + 1)), at
least h / ``MAX_REFINEMENT``, with the lowest level that multiplies the number of nodes by no more than
``NODE_BUDGET``, at least the mean residual within ``CONTACT_DISTANCE`` half-widths of a contact.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mlsanm_cli.app.checks.accuracy import Accuracy, assess_accuracy
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.checks.quality import nodal_contacts
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.build import Refinement, place
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.app.scene.condense import condense_scene
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.contact.complementarity.problem import STICK
from mlsanm_cli.contact.geometry.profile import Patch, contact_patches, half_width
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import Corrected
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.mechanics.supports import corner_weight
from mlsanm_cli.solve.condensed_scene import CondensedScene

MAX_REFINEMENT = 2.0
NODE_BUDGET = 2.0
CONTACT_DISTANCE = 3.0
GROWTH = 0.2
MIN_REFINEMENT = 1.15
"""Nodes that would become finer by less are not refined."""
SYMMETRY_TOLERANCE = 0.05
"""Relative difference of the spacings requested by symmetric nodes, if the loads are symmetric."""
MAX_ZONES = 24
SPACING_TOLERANCE = 1.25
"""Accepted ratio of actual to wanted spacing."""
SNAP_DISTANCE = 0.5
"""Zone centres closer to the symmetry line than this fraction of the wanted spacing are moved onto it."""


def residual_zones(
    built: CondensedScene,
    boundaries: Boundaries,
    bodies: Mapping[str, Corrected],
    patches: tuple[Patch, ...],
    planned: tuple[Zone, ...],
) -> tuple[Zone, ...]:
    """Zones where fits are poor, in addition to the ``planned`` ones; symmetric ones in symmetric clouds."""
    if not bodies:
        return ()
    residuals, ruled = {}, {}
    for name, body in built.scene.bodies.items():
        cloud, stencils, stress = body.model.cloud, body.model.stencils, bodies[name].defect.stress
        # Times the spacing, with its square averaged over the stencil of each node.
        components = np.array([1.0, 1.0, 2.0, 1.0])[: stress.shape[1]]
        square = (stress**2 * components).sum(axis=1) / body.model.material.modulus**2
        mean = np.add.reduceat(square[stencils.indices], stencils.indptr[:-1]) / np.diff(stencils.indptr)
        weight = corner_weight(cloud, body.restrained, body.springs)
        residuals[name] = np.sqrt(mean) * cloud.spacing * weight
        ruled[name] = np.zeros(len(cloud.points), dtype=bool)
        for patch in patches:
            ruled[name] |= np.hypot(*(cloud.points - patch.middle).T) < CONTACT_DISTANCE * patch.half_width
    degree = min(body.model.settings.degree for body in built.scene.bodies.values())
    level = _level(np.concatenate(list(residuals.values())), np.concatenate(list(ruled.values())), degree)
    zones: list[Zone] = []
    for given in built.case.body:
        cloud, line = built.scene.bodies[given.name].model.cloud, None
        finer = np.where(ruled[given.name], 1.0, _finer(residuals[given.name], level, degree))
        if cloud.mirror is not None:
            # Equal at mirror images, unless they differ by more than the discretisation explains.
            image = finer[cloud.mirror.image]
            if np.abs(finer - image).mean() <= SYMMETRY_TOLERANCE * (finer - 1.0).mean():
                finer, line = np.maximum(finer, image), cloud.mirror.line
        wanted = np.where(finer >= MIN_REFINEMENT, cloud.spacing / finer, np.inf)
        spacing = spacing_of(boundaries, given).with_zones((*planned, *zones))
        zones += cover(cloud.points, cloud.spacing, wanted, spacing, line)
    return tuple(zones)


def cover(
    points: FloatArray,
    spacing: FloatArray,
    wanted: FloatArray,
    planned: Spacing,
    line: SymmetryLine | None = None,
) -> tuple[Zone, ...]:
    """Circular refinement zones for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,). At
    most MAX_ZONES zones, twice as many with a symmetry ``line``. Greedy: the node with the largest ratio of
    actual to wanted spacing becomes the centre of a zone, whose radius grows as long as most of the area
    inside wants that spacing; infinity wants nothing. ``planned`` is the spacing without these zones. With a
    ``line`` the zones are symmetric if ``planned`` and ``wanted`` are."""
    has, area, zones = planned.at(points), spacing**2, list[Zone]()
    for _ in range(MAX_ZONES):
        ratio = has / wanted
        worst = int(np.argmax(ratio))
        if ratio[worst] <= SPACING_TOLERANCE:
            break
        h = float(wanted[worst])
        middle = points[worst]
        if line is not None and abs(middle[line.axis] - line.at) < SNAP_DISTANCE * h:
            middle = np.where(np.arange(2) == line.axis, line.at, middle)
        distance = np.hypot(*(points - middle).T)
        near = np.argsort(distance)
        fine = area[near] * (wanted[near] <= SPACING_TOLERANCE * h)
        mostly = np.cumsum(fine) >= 0.7 * np.cumsum(area[near])
        # The largest circle such that this spacing is needed in most of it and of all smaller ones.
        last = int(np.argmin(mostly)) - 1 if not mostly.all() else len(near) - 1
        radius = max(float(distance[near[max(last, 0)]]), h)
        places = [middle] if line is None else np.unique([middle, *line.reflect(middle[None])], axis=0)
        added = tuple(Zone.around(place, h, radius, GROWTH) for place in places)
        zones += added
        has = np.minimum(has, Spacing(planned.far, added).at(points))
    return tuple(zones)


def _finer(residual: FloatArray, level: float, degree: int) -> FloatArray:
    """Required refinement factor (n,) of each node."""
    share = residual / level if level > 0.0 else np.zeros(len(residual))
    return np.asarray(np.clip(share ** (1.0 / (degree + 1)), 1.0, MAX_REFINEMENT))


def _level(residual: FloatArray, ruled: BoolArray, degree: int) -> float:
    """Level of the module's docstring, by bisection of its logarithm."""
    free = residual[~ruled]
    if not len(free) or not free.max() > 0.0:
        return 0.0
    high = np.log(float(free.max()))
    low = high - degree * np.log(10.0) * 4.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (_finer(free, float(np.exp(middle)), degree) ** 2).sum() > NODE_BUDGET * len(free):
            low = middle
        else:
            high = middle
    floor = float(np.sqrt((residual[ruled] ** 2).mean())) if ruled.any() else 0.0
    return max(float(np.exp(high)), floor)


class Rule(NamedTuple):
    """Required spacings of a contact patch: ``across`` spacings per half-width within ``reach`` half-widths
    of its middle, ``at_edge`` at its edges, growing by ``growth`` per unit length outside."""

    across: float
    reach: float
    at_edge: float
    growth: float


LOW_DEGREE_RULE = Rule(20.0, 1.0, 256.0, 0.12)
"""Degrees 1 to 3."""
HIGH_DEGREE_RULE = Rule(10.0, 0.5, 256.0, 0.14)
"""Degrees 4 to 6."""
NODAL_RULE = Rule(10.0, 1.0, 10.0, 0.2)
"""Nodal pressures of the regularised law: even spacings under the patch, as the law smooths its edges."""
RING_RULE = Rule(24.0, 1.0, 96.0, 0.15)
"""Nodal pressures on bodies of revolution: peaks and approaches to 1e-3, radii to 5e-3."""
NODAL_PASSES = 6
"""Largest number of passes to `NODAL_RULE` and `RING_RULE`; each halves the uncertainty of edges at least."""
STICK_REFINEMENT = 64.0
EDGE_TOLERANCE = 0.05
"""Accuracy of contact edges, in half-widths, required for the refinement of stick zones."""
MAX_EDGE_REFINEMENT = 8.0
"""Largest refinement of an edge zone relative to the spacing with which the edge was found."""
MIN_STICK_ZONE = 0.1
"""Least width of a stick zone, relative to its contact."""
CHANGE_TOLERANCE = 2e-4
"""Passes end when no figure changed by more, relatively."""


def set_up(
    case: Case, prepared: SceneModel, context: RunContext, verdicts: Verdicts, known: Refinement | None = None
) -> tuple[SceneModel, CondensedScene, Accuracy, Refinement]:
    """The last scene that could be solved, its errors and the results of all passes: refined as ``known``
    already, or for the requested number of passes or until convergence. Judges contacts with nodal
    pressures."""
    built, accuracy = _solved(case, prepared, context)
    history = [_figures(built, accuracy, None)]
    # The spacings that contact patches require, and the number of passes.
    touching = {body for pairing in prepared.pairings for body in pairing.bodies}
    smooth = any(contact.regularization.law == "hyperbolic" for contact in case.touching)
    bodies = [body for body in case.body if body.name in touching]
    flows = any(case.material[body.material].flows for body in bodies)
    automatic = all(body.spacing == "auto" and not body.has_nodes for body in bodies)
    passes = case.adapt.passes
    if case.model.revolved and case.touching:
        meshed = any(body.has_nodes for body in case.body)
        rule, passes = RING_RULE, passes or (0 if meshed else NODAL_PASSES)
    elif (smooth or flows) and automatic and not passes:
        rule, passes = NODAL_RULE, NODAL_PASSES
    else:
        degree = min(model.settings.degree for model in prepared.models.values())
        rule = LOW_DEGREE_RULE if degree < 4 else HIGH_DEGREE_RULE
    bulk, placed, failed = tuple[Zone, ...](), tuple[Zone, ...](), ""
    for number in range(1, passes + 1) if known is None else ():
        patches = tuple(found_patches(built, rule))
        zones = tuple(zone for patch in patches for zone in _patch_zones(patch, rule))
        # The bulk is refined only once the zones of the contacts no longer limit the accuracy.
        more: tuple[Zone, ...] = ()
        if accuracy.bulk_leads and (case.adapt.passes or rule is not RING_RULE):
            more = residual_zones(built, prepared.boundaries, accuracy.bodies, patches, (*zones, *bulk))
        # By more than the scatter of spacings.
        coarse = [
            (one.uncertainty > 1.5 * one.finest * one.half_width / rule.at_edge).any()
            or one.spacing > 1.2 * one.half_width / rule.across
            for one in patches
        ]
        if not more and not any(coarse):
            context.console.note(f"refinement stops before pass {number}: all clouds are fine enough")
            break
        wanted = (*zones, *bulk, *more)
        try:
            refined = place(prepared.boundaries, context, wanted, prepared)
            built, accuracy = _solved(case, refined, context, built.scene)
        except NumericalError as error:
            failed = f"pass {number} of [adapt] failed, continuing with the previous clouds: {error.message}"
            break
        prepared, bulk, placed = refined, (*bulk, *more), wanted
        history.append(_figures(built, accuracy, history[-1]))
        now = history[-1]
        moved = now["largest_displacement"]
        context.console.note(
            f"pass {number}: {now['nodes']} nodes, peak pressure {now['peak_pressure']:.6g}, "
            f"half-width {now['half_width']:.6g}, {f'largest displacement {moved:.6g}, ' if moved else ''}"
            f"change {now['change']:.2g}"
        )
        if now["change"] <= CHANGE_TOLERANCE:
            break
    if failed:
        verdicts.judge([Check("refinement_pass", 1.0, failed)])
    verdicts.judge(nodal_contacts(prepared, built.condensed.nodal, prepared.models))
    return prepared, built, accuracy, known or Refinement(placed, tuple(history), failed)


def _solved(
    case: Case, prepared: SceneModel, context: RunContext, before: Scene | None = None
) -> tuple[CondensedScene, Accuracy]:
    built = condense_scene(case, prepared, context, before)
    with context.phase("estimate"):
        context.console.phase("estimating errors")
        return built, assess_accuracy(built)


def found_patches(built: CondensedScene, rule: Rule) -> Iterator[Patch]:
    """Patches with an edge at the ends of all stages, and stick zones; corners count if ``revolved`` only."""
    for state in built.ends:
        for pairing in built.condensed.pairings:
            span = built.condensed.spans[pairing.name]
            body, corners = built.scene.bodies[pairing.slave_body], None
            if body.model.cloud.revolved:
                # Contacts may end at corners, but not at those of the axis and of sides that are held.
                sides = [name for name, held in body.restrained.items() if any(held)]
                held = [body.model.cloud.surfaces[name].index for name in sides]
                nodes = np.concatenate([np.zeros(0, dtype=np.int64), *held])
                corners = ~np.isin(pairing.node[pairing.candidate], nodes)
            patches = contact_patches(pairing, state.closed[span], corners)
            closed = [patch for patch in patches if len(patch.edges)]
            yield from closed
            if any((patch.uncertainty > EDGE_TOLERANCE * patch.half_width).any() for patch in closed):
                continue
            # Single sticking nodes among sliding ones are no zone.
            least = MIN_STICK_ZONE * max((patch.half_width for patch in closed), default=np.inf)
            stuck = state.status.status(built.condensed.friction_nodes)[span] == STICK
            for patch in contact_patches(pairing, stuck):
                if patch.half_width > least and len(patch.edges):
                    yield replace(patch, finest=max(rule.at_edge / STICK_REFINEMENT, 1.0))


def _patch_zones(patch: Patch, rule: Rule) -> Iterator[Zone]:
    (x, y), unknown = patch.middle.tolist(), float(patch.uncertainty.max(initial=0.0))
    # Finer spacings over all that a patch may cover are wasted until its edges are known.
    spacing = max(patch.half_width / rule.across, unknown / 2.0)
    yield Zone.around((x, y), spacing, rule.reach * patch.half_width + 2.0 * unknown, rule.growth)
    edges = zip(patch.edges.tolist(), patch.uncertainty.tolist(), patch.apart.tolist(), strict=True)
    for (x, y), unsure, apart in edges:
        finest = max(patch.finest * patch.half_width / rule.at_edge, unsure / MAX_EDGE_REFINEMENT)
        # The zone must also reach the other surface across the initial gap.
        yield Zone.around((x, y), finest, max(2.0 * unsure, 1.5 * apart), rule.growth)


def _figures(built: CondensedScene, accuracy: Accuracy, before: Mapping[str, Any] | None) -> dict[str, Any]:
    """Results of a pass; ``change`` is the largest of peaks and half-widths, else of displacements."""
    condensed = built.condensed
    spans = [(one.arc[one.candidate], condensed.spans[one.name]) for one in condensed.pairings]
    widths = [half_width(arc, state.pressure[span]) for state in built.ends for arc, span in spans]
    figures: dict[str, Any] = {
        "nodes": sum(len(body.model.cloud.points) for body in built.scene.bodies.values()),
        "peak_pressure": max((float(state.pressure.max(initial=0.0)) for state in built.ends), default=0.0),
        "half_width": max(widths, default=0.0),
        "largest_displacement": accuracy.largest,
    }
    change = None
    if before is not None:
        keys = ("peak_pressure", "half_width") if figures["peak_pressure"] else ("largest_displacement",)
        pairs = [(figures[key] or 0.0, before[key] or 0.0) for key in keys]
        change = max(abs(new - old) / old if old else float(new != old) for new, old in pairs)
    return {**figures, "change": change, "error_estimate": accuracy.figures(built)}
