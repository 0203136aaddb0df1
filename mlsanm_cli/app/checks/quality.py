"""Quality of the node clouds and of the loads on their nodes, and warnings with the keys to change."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.causes import distance_warnings
from mlsanm_cli.app.scene.load_profiles import amounts_at, runs_of
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import BodyForce, Case, ExpressionError, Pressure, Temperature, Traction, finer_nodes
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import corners_of
from mlsanm_cli.cloud.quality import CloudQuality, measure
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.response.coercivity import stiffness_ratio
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.corners import reentrant_corners
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Warn = Callable[[str], None]

MIN_SEPARATION = 0.5
"""Nodes closer than this part of the local spacing make stencils ill-conditioned."""
MAX_FILL_DISTANCE = 1.6
"""An empty circle with a radius of more spacings makes stencils one-sided; good clouds have about 1.1."""
MAX_GROWTH = 0.3
"""A spacing that grows faster than this per unit length mixes coarse and fine nodes in one stencil."""
MAX_FILE_GROWTH = 0.6
"""Distances in meshes scatter: good meshes of triangles and quads have values up to 0.5."""
MAX_SPACING_RATIO = 2.0
"""Facing spacings that differ by more may reduce the stability of the contact compliance."""
MAX_STIFFNESS_RATIO = 3.0
"""A slave stiffer than its master by more does not resist oscillations of the pressure."""
MAX_BOND_TURN = 0.22
"""Rotation (radian) of a bonded surface from node to node above which a run warns, as errors of its tractions
are not estimated: at 0.24 pressures and tractions on a stiff fibre are 4 and 9 % off (L2), at 0.16 1.6 and
2.8 %; it carried 2 % too little with uniform nodes at 0.25, and 5 to 20 % in growing spacings."""
MAX_FRICTION = 4.0
"""Coefficient of friction above which it is probably a percentage: rubber has up to 4."""
MAX_INTERPOLATION_ERROR = 0.08
"""Largest error of linear interpolation of a load between nodes, relative to its largest value. Stresses of a
hot spot were 20 % off with an error of 12 %, and 1 % with 5 %, as automatic spacings may leave."""
LENGTH_TOLERANCE = 0.01
"""Largest relative error of the length of a loaded part."""


@dataclass(frozen=True)
class Quality:
    """Quality measures of the clouds and the models by body, ratio of facing spacings by contact, and
    warnings."""

    bodies: Mapping[str, CloudQuality]
    models: Mapping[str, BodyModel]
    spacing_ratio: Mapping[str, float]
    warnings: tuple[str, ...]

    @property
    def figures(self) -> dict[str, Any]:
        """Quality measures as plain values."""
        return {
            "bodies": {
                name: asdict(cloud)
                | {
                    "degree": self.models[name].settings.degree,
                    "stencils_enlarged": self.models[name].stencils.enlarged,
                    "worst_ratio": self.models[name].stencils.worst_ratio,
                }
                for name, cloud in self.bodies.items()
            },
            "spacing_ratio": dict(self.spacing_ratio),
        }


def announce(case: Case, prepared: SceneModel, context: RunContext, warn: Warn) -> Quality:
    """Assess a scene, print its notes and emit its warnings."""
    with context.phase("cloud"):
        quality = assess(case, prepared, context.memo)
    for note in prepared.notes:
        context.console.note(note)
    for warning in (*quality.warnings, *case_warnings(case)):
        warn(warning)
    return quality


def assess(case: Case, prepared: SceneModel, memo: Memo = NO_CACHE) -> Quality:
    """Measure the clouds of all bodies and the facing spacings of every contact."""
    brought = {body.name for body in case.body if body.has_nodes}
    graded = {body.name for body in case.body if body.refine}
    bodies = {
        name: memo.value("quality", model.cloud.content, partial(measure, model.cloud))
        for name, model in prepared.models.items()
    }
    clouds = {name: model.cloud for name, model in prepared.models.items()}
    ratios = {pairing.name: spacing_ratio(pairing, clouds) for pairing in prepared.pairings}
    warnings: list[str] = []
    for name, cloud in bodies.items():
        warnings += _cloud_warnings(name, cloud, name in brought, name in graded)
    # At finite strain automatic spacings are made alike where bodies touch, which a first run finds.
    own = {one.name for one in case.body if case.model.strain == "small" or one.spacing != "auto"}
    nodal = [pairing for pairing in prepared.pairings if pairing.name not in prepared.ranges]
    warnings += nodal_warnings(prepared, nodal, own | brought)
    warnings += _bond_warnings(case, prepared.pairings, clouds)
    if any(model.settings.degree == 1 for model in prepared.models.values()):
        warnings.append(
            "mls.degree = 1 is for comparisons only, its error hardly decreases with the spacing; use 2"
        )
    warnings += distance_warnings(prepared.pairings, clouds)
    warnings += load_warnings(case, prepared.boundaries, clouds)
    warnings += [motion.warning for motion in prepared.weak if motion.idle is None]
    warnings += [text for name, model in prepared.models.items() for text in _corner_warnings(name, model)]
    return Quality(bodies, prepared.models, ratios, tuple(warnings))


def nodal_warnings(prepared: SceneModel, pairings: Iterable[Pairing], own: Collection[str]) -> Iterator[str]:
    """Warnings of contacts with nodal pressures; of spacings, if one is its body's ``own``."""
    clouds = {name: model.cloud for name, model in prepared.models.items()}
    for one in pairings:
        if one.bonded:
            continue
        ratio = spacing_ratio(one, clouds)
        if ratio > MAX_SPACING_RATIO * (1.0 + COARSE_ROUND_OFF) and not set(own).isdisjoint(one.bodies):
            yield ratio_message(one, ratio)
        yield from _divided_warnings(one)
        yield from _tip_warnings(one, prepared.pairings)
        stiffer = stiffness_ratio(one, prepared.models)
        if stiffer > MAX_STIFFNESS_RATIO:
            yield (
                f"contact {one.name}: the slave is {stiffer:.3g} times stiffer than the master; "
                f"swap them: pressures are more accurate with the softer body as slave"
            )


def _tip_warnings(pairing: Pairing, pairings: Sequence[Pairing]) -> Iterator[str]:
    """Warning of a contact that ends where a bond of the same bodies begins. A crack of 20 nodes, pressed and
    sheared, slips within 0.2 %, but the pressure of its last nodes is 0 to 2 times the exact one."""
    curve = pairing.slave.curve
    bonds = [one for one in pairings if one.bonded and set(one.bodies) == set(pairing.bodies)]
    if not bonds or curve.closed:
        return
    held = np.concatenate([one.points[one.candidate] for one in bonds])
    for end in curve.points(np.array([0.0, curve.length])):
        if np.hypot(*(held - end).T).min() <= COARSE_ROUND_OFF * curve.length:
            yield (
                f"contact {pairing.name} ends where a bond begins, near ({end[0]:.6g}, {end[1]:.6g}), as at "
                f"the tip of a crack: the pressures of some nodes next to it, and so the peak, depend on the "
                f"spacing"
            )
            return


def _divided_warnings(pairing: Pairing) -> Iterator[str]:
    """Warnings of surfaces that may touch on both sides of a corner, as a disk in a groove: contact grids end
    at corners."""
    sides = ((pairing.slave, pairing.points), (pairing.master, pairing.partner))
    for (surface, points), name in zip(sides, pairing.names, strict=False):
        corners = np.zeros(0) if surface is None else corners_of(surface.curve)
        if surface is None or not len(corners):
            continue
        arcs = surface.curve.closest(points[pairing.candidate])
        for corner, (x, y) in zip(corners, surface.curve.points(corners), strict=True):
            if arcs.min() < corner < arcs.max():
                yield (
                    f"contact {pairing.name}: {name} has a corner at ({x:.6g}, {y:.6g}), where contact grids "
                    f"end: pressures are those at nodes; define a contact for each of both sides, with names "
                    f"of their own"
                )
                break


def _bond_warnings(case: Case, pairings: Sequence[Pairing], clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Warnings of bonded curves with too few nodes."""
    sides = [(one, body, slave) for one in pairings if one.bonded for body, slave, _ in one.sides]
    for pairing, body, slave in sides:
        surface = pairing.surface_of(slave)
        bend = np.abs(surface.curve.curvature(surface.arc_length))
        turn = float((bend * clouds[body].spacing[surface.index]).max())
        if turn > MAX_BOND_TURN:
            yield (
                f"contact {pairing.name}: the bonded surface of body {body} turns by {np.degrees(turn):.2g} "
                f"degrees from node to node, too far for its stresses; {finer_nodes(case, [body])} there"
            )


def ratio_message(pairing: Pairing, ratio: float) -> str:
    """Warning of unequal facing spacings."""
    return (
        f"contact {pairing.name}: spacings that face each other differ by a factor of {ratio:.3g}; "
        f"bring the spacings of {' and '.join(pairing.names)} closer together "
        f"({', '.join(f'body.{body}.spacing' for body in pairing.bodies)}, or their refinements)"
    )


def _corner_warnings(name: str, model: BodyModel) -> Iterator[str]:
    corners = reentrant_corners(model.cloud)
    if len(corners):
        x, y = model.cloud.points[corners[0]]
        more = f" and {len(corners) - 1} more" if len(corners) > 1 else ""
        slow = "" if model.tips is not None else ", and stiffness converges slowly"
        yield (
            f"body {name}: a sharp corner points into the material at ({x:.6g}, {y:.6g}){more}; the stress "
            f"there is singular{slow}: give it a radius in body.{name}.shape.rounding"
        )


def _cloud_warnings(name: str, cloud: CloudQuality, brought: bool, graded: bool) -> Iterator[str]:
    grade = f"body.{name}.refine growth"
    lower = f"lower {grade}, or " if graded else ""
    found = []
    if cloud.closest < MIN_SEPARATION:
        message = f"two nodes are only {cloud.closest:.2g} of the local spacing apart"
        found.append((message, f"{lower}try another body.{name}.seed"))
    if cloud.hole > MAX_FILL_DISTANCE:
        message = f"the largest gap between nodes has a radius of {cloud.hole:.3g} spacings"
        found.append((message, f"{lower}make body.{name}.spacing smaller"))
    if cloud.growth > (MAX_FILE_GROWTH if brought else MAX_GROWTH) * (1.0 + COARSE_ROUND_OFF):
        message = f"the spacing grows by {cloud.growth:.3g} per unit length"
        found.append((message, f"lower {grade} to {MAX_GROWTH:g} or less"))
    for message, hint in found:
        remedy = f"make the nodes in body.{name}.shape.file more even" if brought else hint
        yield f"body {name}: {message}; {remedy}"


def factor_notes(scene: Scene) -> Iterator[str]:
    """Notes on bodies whose factorisation had to use a slower method; residuals are checked as usual."""
    for name, body in scene.bodies.items():
        if body.equations.note:
            yield f"body {name}: {body.equations.note}"


def case_warnings(case: Case) -> Iterator[str]:
    """Warnings of contact laws that do not suit the loads, and of undetermined stresses."""
    for name, material in case.material.items():
        if case.model.plane == "strain" and material.form == "stiffness":
            yield (
                f"material {name}: a plane stiffness does not determine the out-of-plane stress, so that von "
                f"Mises stresses are nan; give E1, E2, G12, nu12 and the constants of the third axis"
            )
    for contact in case.touching:
        if isinstance(contact.friction, float) and contact.friction > MAX_FRICTION:
            yield (
                f"contact {contact.name}: friction = {contact.friction:g} is above all known coefficients; "
                f"if it is a percentage, use {contact.friction / 100.0:g}"
            )


def load_warnings(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Warnings of loads that the nodes do not resolve, and of loaded parts with another length."""
    yield from _part_warnings(case, boundaries, clouds)
    for load in case.load:
        if isinstance(load, Temperature | BodyForce):
            amounts = [load.temperature] if isinstance(load, Temperature) else list(load.body_force)
            cloud = clouds[load.body]
            spans = [cloud.triangles]
        elif isinstance(load, Pressure | Traction):
            given = [load.pressure] if isinstance(load, Pressure) else list(load.traction or ())
            amounts = [0.0 if one is None else one for one in given]
            cloud = clouds[load.owner]
            indices = [cloud.surfaces[name].index for name in boundaries.names(load.place)]
            # Only inside of surfaces: tractions may be discontinuous at their ends.
            spans = [np.stack([index[1:-2], index[2:-1]], axis=1) for index in indices if len(index) > 3]
        else:
            continue
        varying = [one for one in amounts if isinstance(one, str)]
        if varying and spans:
            yield from _warning(load.name, load.owner, varying, cloud, np.concatenate(spans))


def _part_warnings(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Warnings of loaded parts with another length than given, as the nodes are from a file."""
    for load in case.load:
        if not isinstance(load, Pressure | Traction) or load.ends is None:
            continue
        surfaces = clouds[load.owner].surfaces
        found = sum(surfaces[name].curve.length for name in boundaries.names(load.place))
        body = next(one for one in case.body if one.name == load.owner)
        wanted = sum(curve.length for _, _, curve in runs_of(body.shape, load.place))
        if abs(found - wanted) > LENGTH_TOLERANCE * wanted:
            yield (
                f"load.{load.name} acts on a length of {found:.4g} instead of {wanted:.4g}, as parts of body "
                f"{load.owner} end at nodes; put nodes of the file at from and to, or use an expression"
            )


def _warning(name: str, body: str, varying: list[str], cloud: Cloud, spans: IntArray) -> Iterator[str]:
    """A warning if means over the ``spans`` (s, 2 or 3) of nodes differ from the values at their centres."""
    middles: FloatArray = cloud.points[spans].mean(axis=1)
    nodes, place = np.unique(spans, return_inverse=True)
    try:
        at_nodes, between = amounts_at(varying, cloud.points[nodes]), amounts_at(varying, middles)
    except ExpressionError:
        # Reported when loads are evaluated at the nodes.
        return
    # A peak at a single node is seen at the nodes only.
    scale = float(max(np.abs(between).max(initial=0.0), np.abs(at_nodes).max(initial=0.0)))
    missed = np.abs(at_nodes[place.reshape(spans.shape)].mean(axis=1) - between).max(axis=1)
    worst = int(missed.argmax())
    if missed[worst] > MAX_INTERPOLATION_ERROR * scale:
        x, y = middles[worst]
        yield (
            f"load.{name} varies faster than the nodes of body {body} resolve near ({x:.4g}, {y:.4g}): "
            f"interpolation between them is off by {100 * missed[worst] / scale:.2g} % of its largest value; "
            f"refine there with body.{body}.refine, or use a smoother expression"
        )
