"""``[adapt] passes``: solve, refine where contact begins and ends and where fits are poor, solve again.

What limits a pressure profile is the position of the contact's edges, known to half a spacing, and then the
spacing under the contact. Every pass asks for ``ACROSS`` spacings over the half-width of each patch found and
refines around its edges, within twice the distance in which an edge is known to lie, up to ``AT_EDGE``
spacings per half-width. Once these are known well enough, the edges of zones that stick get ``AT_STICK``.
Zones of an earlier pass give way to those of the next, which knows better. Both bodies get the same zones, so
that their spacings stay matched. Where the error estimate says that the bodies themselves limit the result,
and in every scene without contact, the bulk is refined by its residual, and these zones stay. Nothing of it
comes from the case.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from mlsanm_cli.app.assessment.accuracy import Accuracy, assess_accuracy
from mlsanm_cli.app.assessment.residual import residual_zones
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import condense_scene, place
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.patches import Patch, contact_patches
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.condensed_scene import CondensedScene


@dataclass(frozen=True)
class Rule:
    """What a patch of contact asks for: ``across`` spacings over its half-width within ``reach`` half-widths
    of its middle, ``at_edge`` at its edges, and spacings that grow by ``growth`` per unit length outside."""

    across: float
    reach: float
    at_edge: float
    growth: float


ROUGH = Rule(20.0, 1.0, 256.0, 0.12)
"""Degrees 1 to 3."""
SMOOTH = Rule(10.0, 0.5, 256.0, 0.14)
"""Degrees 4 to 6. Over six seeds of three scenes a quarter of the nodes less than by the other rule, and
errors of 0.10 to 0.18 % instead of 0.10 to 0.19 %. With spacings that grow by 0.16 some were not stable."""
AT_STICK = 64.0
KNOWN = 0.05
"""Edges of contact are known well enough for stick zones when they are this near, in half-widths."""
FINER = 8.0
"""An edge zone is at most so many times finer than what the edge was found with."""
STICK_ZONE = 0.1
"""A stick zone is wider than this part of its contact."""
TOLERANCE = 2e-4
"""Passes end when nothing that :class:`Pass` compares changed by more, relatively."""


@dataclass(frozen=True)
class Pass:
    """Figures after one pass; ``change`` is the largest relative change of peak pressure and half-width, or
    of the largest displacement where nothing is pressed."""

    nodes: int
    peak_pressure: float
    half_width: float
    largest_displacement: float | None
    change: float | None
    error_estimate: Mapping[str, Any]


@dataclass(frozen=True)
class Refinement:
    """What refined clouds follow from: ``zones`` (z, 5) with centre, spacing, radius and growth, the history
    that led to them, and how a further pass ``failed``, if one did."""

    zones: FloatArray
    passes: tuple[Pass, ...]
    failed: str = ""


@dataclass(frozen=True)
class Adapted:
    """The last good pass's scene, and the history of all."""

    prepared: SceneModel
    built: CondensedScene
    accuracy: Accuracy
    refinement: Refinement

    @property
    def passes(self) -> tuple[Pass, ...]:
        """One entry for every scene solved."""
        return self.refinement.passes

    @property
    def warnings(self) -> tuple[str, ...]:
        """What users should know of the refinement, usually nothing."""
        return (self.refinement.failed,) if self.refinement.failed else ()

    @property
    def refined(self) -> bool:
        """Whether the clouds are other than the case's own."""
        return len(self.passes) > 1

    @property
    def figures(self) -> list[dict[str, Any]]:
        """The history as plain values."""
        return [asdict(one) for one in self.passes]


def refine_again(case: Case, found: Refinement, context: RunContext) -> Adapted:
    """The scene that an earlier process refined."""
    zones = tuple(Zone.around((x, y), *more) for x, y, *more in found.zones.tolist())
    prepared = place(case, context, zones)
    return Adapted(prepared, *_solved(case, prepared, context), found)


def adapt(case: Case, prepared: SceneModel, context: RunContext) -> Adapted:
    """Complete the scene, and refine it as often as the case asks or until nothing changes any more.

    Where a refined scene cannot be solved, as its contact is not stable, the one before it stands.
    """
    built, accuracy = _solved(case, prepared, context)
    history = [_figures(built, accuracy, None)]
    rule = rule_for(min(model.settings.degree for model in prepared.models.values()))
    bulk: tuple[Zone, ...] = ()
    placed: tuple[Zone, ...] = ()
    failed = ""
    for number in range(1, case.adapt.passes + 1):
        patches = tuple(found_patches(built, rule))
        zones = tuple(zone for patch in patches for zone in _patch_zones(patch, rule))
        # Nodes in the bulk are wasted as long as it is the contact's own zones that are too coarse.
        more: tuple[Zone, ...] = ()
        if accuracy.bulk_leads:
            more = residual_zones(built, accuracy.defects, patches, (*zones, *bulk))
        if not more and not any(_is_coarse(patch, rule) for patch in patches):
            context.console.note(f"refinement stops before pass {number}: all clouds are fine enough")
            break
        wanted = (*zones, *bulk, *more)
        try:
            refined = place(case, context, wanted, prepared)
            built, accuracy = _solved(case, refined, context, built.scene)
        except NumericalError as error:
            failed = f"pass {number} of [adapt] failed, continuing with the previous clouds: {error.message}"
            break
        prepared, bulk, placed = refined, (*bulk, *more), wanted
        history.append(_figures(built, accuracy, history[-1]))
        now = history[-1]
        context.console.note(
            f"pass {number}: {now.nodes} nodes, peak pressure {now.peak_pressure:.6g}, "
            f"half-width {now.half_width:.6g}, largest displacement {now.largest_displacement:.6g}, "
            f"change {now.change:.2g}"
        )
        if now.change is not None and now.change <= TOLERANCE:
            break
    return Adapted(prepared, built, accuracy, Refinement(_table(placed), tuple(history), failed))


def _table(zones: tuple[Zone, ...]) -> FloatArray:
    """Round zones, which are all that passes ask for, as rows (z, 5)."""
    rows = []
    for zone in zones:
        assert isinstance(zone.curve, Segment)
        assert zone.curve.start == zone.curve.end
        rows.append((*zone.curve.start, zone.spacing, zone.radius, zone.growth))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _solved(
    case: Case,
    prepared: SceneModel,
    context: RunContext,
    before: Scene | None = None,
) -> tuple[CondensedScene, Accuracy]:
    built = condense_scene(case, prepared, context, before)
    with context.phase("estimate"):
        context.console.phase("estimating errors")
        return built, assess_accuracy(built)


def found_patches(built: CondensedScene, rule: Rule) -> Iterator[Patch]:
    """Patches with an edge in the exact states at the ends of all stages, with friction also stick zones.

    A surface that is closed from end to end has no edge, and nothing to refine.
    """
    for state in built.ends:
        for pairing in built.condensed.pairings:
            span = built.condensed.spans[pairing.name]
            closed = [patch for patch in contact_patches(pairing, state.active[span]) if len(patch.edges)]
            yield from closed
            if any((patch.uncertainty > KNOWN * patch.half_width).any() for patch in closed):
                continue
            # Stray nodes that stick or slip among others are no zone.
            least = STICK_ZONE * max((patch.half_width for patch in closed), default=np.inf)
            for patch in contact_patches(pairing, state.stuck[span]):
                if patch.half_width > least and len(patch.edges):
                    yield replace(patch, finest=rule.at_edge / AT_STICK)


def rule_for(degree: int) -> Rule:
    """The rule that suits local polynomials of a degree."""
    return ROUGH if degree < 4 else SMOOTH


def _is_coarse(patch: Patch, rule: Rule) -> bool:
    """Whether another pass would refine around the patch by more than spacings vary anyway."""
    edges = patch.uncertainty > 1.5 * patch.finest * patch.half_width / rule.at_edge
    return bool(edges.any()) or patch.spacing > 1.2 * patch.half_width / rule.across


def _patch_zones(patch: Patch, rule: Rule) -> Iterator[Zone]:
    """Zones under the patch and around its edges."""
    middle = (float(patch.middle[0]), float(patch.middle[1]))
    reach = rule.reach * patch.half_width + 2.0 * float(patch.uncertainty.max())
    yield Zone.around(middle, patch.half_width / rule.across, reach, rule.growth)
    for edge, unsure, apart in zip(patch.edges, patch.uncertainty, patch.apart, strict=True):
        finest = max(patch.finest * patch.half_width / rule.at_edge, float(unsure) / FINER)
        # The zone must reach the other surface too, which closed a gap there.
        radius = max(2.0 * float(unsure), 1.5 * float(apart))
        yield Zone.around((float(edge[0]), float(edge[1])), finest, radius, rule.growth)


def _figures(built: CondensedScene, accuracy: Accuracy, before: Pass | None) -> Pass:
    """Largest peak pressure and half-width over the contacts and stages."""
    peak = width = 0.0
    for state in built.ends:
        peak = max(peak, float(state.pressure.max(initial=0.0)))
        for pairing in built.condensed.pairings:
            pressure = state.pressure[built.condensed.spans[pairing.name]]
            width = max(width, half_width(pairing.arc[pairing.candidate], pressure))
    nodes = sum(len(body.model.cloud.points) for body in built.scene.bodies.values())
    change = None
    if before is not None:
        pairs = [(peak, before.peak_pressure), (width, before.half_width)]
        if peak == 0.0:
            pairs = [(accuracy.largest or 0.0, before.largest_displacement or 0.0)]
        change = max(abs(new - old) / old if old else float(new != old) for new, old in pairs)
    return Pass(nodes, peak, width, accuracy.largest, change, accuracy.figures(built))
