"""Checks of a model before the path: clouds, facing surfaces, loads on nodes, and the case."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.checks.check import Check, Verdicts, all_of, level
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.condense import pulling_loads
from mlsanm_cli.app.scene.corners import end_of
from mlsanm_cli.app.scene.loads import amounts_at, amounts_of, runs_of
from mlsanm_cli.case import (
    Case,
    Displacement,
    ExpressionError,
    Force,
    ObstacleMotion,
    Platen,
    Pressure,
    Traction,
    finer_nodes,
    rounded,
)
from mlsanm_cli.cloud.cloud import Cloud, nearest
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.response.coercivity import stiffness_ratio
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.near_field import as_complex
from mlsanm_cli.mechanics.supports import reentrant_corners
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

TRIANGLES = 256
"""Triangles processed at once in the search for the largest hole, largest first."""


def measure(cloud: Cloud) -> dict[str, float]:
    """Quality figures of a cloud: numbers of ``nodes`` and ``boundary_nodes``; over the local spacing the
    ``closest`` distance of two nodes and the radius of the largest ``hole``, an empty circle; ``growth``, the
    largest spacing difference of neighbours over their distance."""
    corners = cloud.points[cloud.triangles]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a
    twice = 2.0 * cross(ab, ac)
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    x = (ac[:, 1] * ab2 - ab[:, 1] * ac2) / twice
    y = (ab[:, 0] * ac2 - ac[:, 0] * ab2) / twice
    center, radius = a + np.stack([x, y], axis=1), np.hypot(x, y)
    # Flat triangles along the outline have their centres outside. A centre is inside if it lies behind the
    # tangent at the nearest boundary node.
    normals = np.zeros_like(cloud.points)
    for surface in cloud.surfaces.values():
        normals[surface.index] += surface.normal
    boundary = cloud.boundary_nodes
    outline = cKDTree(cloud.points[boundary])
    # Upper bounds: the nearest node of a circumcentre is a corner of the triangle.
    most = radius / cloud.spacing[cloud.triangles].min(axis=1)
    largest, order = 0.0, np.argsort(-most)
    for some in np.split(order, range(TRIANGLES, len(order), TRIANGLES)):
        near = boundary[nearest(outline, center[some])[1]]
        inside = ((center[some] - cloud.points[near]) * normals[near]).sum(axis=1) < 0.0
        # Opened slits are not Delaunay: nodes may lie within circumcircles.
        away, node = nearest(cloud.tree, center[some])
        largest = float((away / cloud.spacing[node])[inside].max(initial=largest))
        if largest >= most[some[-1]]:
            break
    closest, growth = cloud.separation
    counts = {"nodes": len(cloud.points), "boundary_nodes": len(cloud.boundary_nodes)}
    return counts | {"closest": float(closest.min()), "hole": largest, "growth": growth}


@dataclass(frozen=True)
class Quality:
    """A scene of a ``case`` with the measures of its clouds by body, and ratios of facing spacings."""

    case: Case
    prepared: SceneModel
    bodies: Mapping[str, Mapping[str, float]]
    spacing_ratio: Mapping[str, float]

    def figures(self, models: Mapping[str, BodyModel]) -> dict[str, Any]:
        """The measures, with the stencils of ``models``, as plain values."""
        bodies = {
            name: {
                **measures,
                "degree": models[name].settings.degree,
                "stencils_enlarged": models[name].stencils.enlarged,
                "worst_ratio": models[name].stencils.worst_ratio,
            }
            for name, measures in self.bodies.items()
        }
        return {"bodies": bodies, "spacing_ratio": dict(self.spacing_ratio)}


def announce(case: Case, prepared: SceneModel, context: RunContext, verdicts: Verdicts) -> Quality:
    with context.phase("cloud"):
        quality = assess(case, prepared, context.memo)
    for note in prepared.notes:
        context.console.note(note)
    verdicts.judge(all_of(MODEL, quality))
    return quality


def assess(case: Case, prepared: SceneModel, memo: Memo = NO_CACHE) -> Quality:
    """Measure the clouds of all bodies and the facing spacings of every contact."""
    clouds = prepared.clouds
    bodies = {name: memo.value("quality", one.content, partial(measure, one)) for name, one in clouds.items()}
    ratios = {pairing.name: spacing_ratio(pairing, clouds) for pairing in prepared.pairings}
    return Quality(case, prepared, bodies, ratios)


def clouds(model: Quality) -> Iterator[Check]:
    for body in model.case.body:
        name, place = body.name, f"body {body.name}"
        closest, hole, growth = (model.bodies[name][key] for key in ("closest", "hole", "growth"))
        grade = f"body.{name}.refine growth"
        lower = f"lower {grade}, or " if body.refine else ""
        even = f"make the nodes in body.{name}.shape.file more even" if body.has_nodes else ""
        message = f"{place}: two nodes are only {closest:.2g} of the local spacing apart"
        yield Check("node_distance", closest, message, even or f"{lower}try another body.{name}.seed", place)
        message = f"{place}: the largest gap between nodes has a radius of {hole:.3g} spacings"
        yield Check("node_hole", hole, message, even or f"{lower}make body.{name}.spacing smaller", place)
        message = f"{place}: the spacing grows by {growth:.3g} per unit length"
        hint = even or f"lower {grade} to {level('spacing_growth'):g} or less"
        yield Check("mesh_growth" if body.has_nodes else "spacing_growth", growth, message, hint, place)


def facing_surfaces(model: Quality) -> Iterator[Check]:
    # At finite strain automatic spacings are made alike where bodies touch, which a first run finds.
    small, ranges = model.case.model.strain == "small", model.prepared.ranges
    own = {one.name for one in model.case.body if small or one.spacing != "auto" or one.has_nodes}
    nodal = [pairing for pairing in model.prepared.pairings if pairing.name not in ranges]
    yield from nodal_contacts(model.prepared, nodal, own)


def nodal_contacts(
    prepared: SceneModel, pairings: Iterable[Pairing], own: Collection[str]
) -> Iterator[Check]:
    """Checks of contacts with nodal pressures; of spacings, if one is its body's ``own``."""
    for one in (one for one in pairings if not one.bonded):
        place = f"contact {one.name}"
        if not set(own).isdisjoint(one.bodies):
            ratio = spacing_ratio(one, prepared.clouds)
            yield Check("facing_spacings", ratio, *ratio_message(one, ratio), place)
        # Surfaces may touch on both sides of a corner, as a disk in a groove.
        for (_, slave, _), name in zip(one.sides, one.names, strict=True):
            curve, points = one.surface_of(slave).curve, one.points if slave else one.partner
            if not len(curve.corners):
                continue
            arcs, at = curve.closest(points[one.candidate]), curve.corners
            inside = curve.points(at[(at > arcs.min()) & (at < arcs.max())])
            for x, y in inside[:1]:
                message = (
                    f"{place}: {name} has a corner at ({x:.6g}, {y:.6g}), where contact grids end: pressures "
                    f"are those at nodes"
                )
                hint = "define a contact for each of both sides, with names of their own"
                yield Check("contact_corner", len(inside), message, hint, f"{place}, {name}")
        bonds = [bond for bond in prepared.pairings if bond.bonded and set(bond.bodies) == set(one.bodies)]
        if bonds and not one.slave.curve.closed:
            curve, held = one.slave.curve, np.concatenate([bond.points[bond.candidate] for bond in bonds])
            ends, least = curve.points(np.array([0.0, curve.length])), COARSE_ROUND_OFF * curve.length
            tips = [end for end in ends if np.hypot(*(held - end).T).min() <= least]
            for x, y in tips[:1]:
                message = (
                    f"{place} ends where a bond begins, near ({x:.6g}, {y:.6g}), as at the tip of a crack: "
                    f"the pressures of some nodes next to it, and so the peak, depend on the spacing"
                )
                yield Check("crack_tip", len(tips), message, place=place)
        stiffer = stiffness_ratio(one, prepared.models)
        message = f"{place}: the slave is {stiffer:.3g} times stiffer than the master"
        hint = "swap them, `from` and `to` too: pressures are more accurate with the softer body as slave"
        yield Check("slave_stiffness", stiffer, message, hint, place)


def ratio_message(pairing: Pairing, ratio: float) -> tuple[str, str]:
    keys = ", ".join(f"body.{body}.spacing" for body in pairing.bodies)
    return (
        f"contact {pairing.name}: spacings that face each other differ by a factor of {ratio:.3g}",
        f"bring the spacings of {' and '.join(pairing.names)} closer together ({keys}, or their refinements)",
    )


def bonded_curves(model: Quality) -> Iterator[Check]:
    bonds = [one for one in model.prepared.pairings if one.bonded]
    for pairing, body, slave in ((one, body, slave) for one in bonds for body, slave, _ in one.sides):
        surface = pairing.surface_of(slave)
        bend = np.abs(surface.curve.curvature(surface.arc_length))
        turn = float((bend * model.prepared.clouds[body].spacing[surface.index]).max())
        message = (
            f"contact {pairing.name}: the bonded surface of body {body} turns by {np.degrees(turn):.2g} "
            f"degrees from node to node, too far for its stresses"
        )
        hint = f"{finer_nodes(model.case, [body])} there"
        yield Check("bonded_curve", turn, message, hint, f"contact {pairing.name}, body {body}")


def degree(model: Quality) -> Iterator[Check]:
    lowest = min(one.settings.degree for one in model.prepared.models.values())
    message = "mls.degree = 1 is for comparisons only, its error hardly decreases with the spacing"
    yield Check("degree", lowest, message, "use 2")


def initial_gap(model: Quality) -> Iterator[Check]:
    for pairing in model.prepared.pairings:
        size = min(float(np.ptp(model.prepared.clouds[body].points, axis=0).max()) for body in pairing.bodies)
        gap, place = float(pairing.gap.min()) + pairing.closed_by, f"contact {pairing.name}"
        message = (
            f"{place}: the initial gap of {gap:.3g} is {gap / size:.2g} times the size of the smaller body"
        )
        hint = "move the bodies together, unless they are meant to move so far"
        yield Check("initial_gap", gap / size, message, hint, place)


def load_resolution(model: Quality) -> Iterator[Check]:
    """Errors of linear interpolation of varying loads between the nodes."""
    for load in model.case.load:
        if isinstance(load, Displacement | Force | Platen | ObstacleMotion):
            continue
        cloud = model.prepared.clouds[load.owner]
        spans = [] if load.places else [cloud.triangles]
        for place in load.places:
            # Only inside of surfaces: tractions may be discontinuous at their ends.
            indices = (cloud.surfaces[name].index for name in model.prepared.boundaries.names[place])
            spans += [np.stack([index[1:-2], index[2:-1]], axis=1) for index in indices if len(index) > 3]
        varying, error, x, y = [one for one in amounts_of(load) if isinstance(one, str)], 0.0, 0.0, 0.0
        # Without a value at some node the load is refused when it is evaluated there.
        with suppress(ExpressionError):
            if varying and spans:
                # The mean over a span from the value at its centre, over the largest value; a peak at a
                # single node is seen at the nodes only.
                corners = np.concatenate(spans)
                nodes, at = np.unique(corners, return_inverse=True)
                middles = cloud.points[corners].mean(axis=1)
                known, between = amounts_at(varying, cloud.points[nodes]), amounts_at(varying, middles)
                scale = max(np.abs(between).max(initial=0.0), np.abs(known).max(initial=0.0))
                missed = np.abs(known[at.reshape(corners.shape)].mean(axis=1) - between).max(axis=1)
                if scale > 0.0:
                    error = float(missed.max() / scale)
                    x, y = middles[int(missed.argmax())].tolist()
        message = (
            f"load.{load.name} varies faster than the nodes of body {load.owner} resolve near ({x:.4g}, "
            f"{y:.4g}): interpolation between them is off by {100 * error:.2g} % of its largest value"
        )
        hint = f"refine there with body.{load.owner}.refine, or use a smoother expression"
        yield Check("load_resolution", error, message, hint, f"load {load.name}")


def loaded_length(model: Quality) -> Iterator[Check]:
    for load in model.case.load:
        if not isinstance(load, Pressure | Traction) or load.ends is None:
            continue
        surfaces, boundaries = model.prepared.clouds[load.owner].surfaces, model.prepared.boundaries
        found = sum(surfaces[name].curve.length for name in boundaries.names[load.place])
        wanted = sum(run.part.length for run in runs_of(boundaries.drawn[load.owner], load.place))
        message = (
            f"load.{load.name} acts on a length of {found:.4g} instead of {wanted:.4g}, as parts of body "
            f"{load.owner} end at nodes"
        )
        hint = "put nodes of the file at from and to, or use an expression"
        yield Check("loaded_length", abs(found - wanted) / wanted, message, hint, f"load {load.name}")


def weak_motions(model: Quality) -> Iterator[Check]:
    for text in model.prepared.restrained.weak:
        message, _, hint = text.partition("; ")
        yield Check("weak_motion", 1.0, message, hint, message.partition(" is hardly")[0])


def corners(model: Quality) -> Iterator[Check]:
    for name, one in model.prepared.models.items():
        sharp = one.cloud.points[reentrant_corners(one.cloud)]
        for x, y in sharp[:1]:
            more = f" and {len(sharp) - 1} more" if len(sharp) > 1 else ""
            slow = "" if one.tips is not None else ", and stiffness converges slowly"
            message = (
                f"body {name}: a sharp corner points into the material at ({x:.6g}, {y:.6g}){more}; the "
                f"stress there is singular{slow}: {rounded(model.case, name)}"
            )
            yield Check("reentrant_corners", len(sharp), message, place=f"body {name}")


def materials(model: Quality) -> Iterator[Check]:
    """Stresses out of the plane that are not known, and moduli whose units may differ."""
    for name, material in model.case.material.items():
        if model.case.model.plane == "strain" and material.form == "stiffness":
            place = f"material {name}"
            message = (
                f"{place}: a plane stiffness does not determine the out-of-plane stress, so that von Mises "
                "stresses are nan"
            )
            hint = "give E1, E2, G12, nu12 and the constants of the third axis"
            yield Check("plane_stiffness", 1.0, message, hint, place)
    for pairing in model.prepared.pairings:
        ratio = stiffness_ratio(pairing, model.prepared.models)
        if ratio > 0.0:
            stiffer, place = max(ratio, 1.0 / ratio), f"contact {pairing.name}"
            message = f"{place}: one body is {stiffer:.2g} times as stiff as the other"
            hint = "check that the moduli of all materials have the same unit"
            yield Check("moduli", stiffer, message, hint, place)


def pulled_apart(model: Quality) -> Iterator[Check]:
    """Loads of the wrong sign."""
    for load, body, contact in pulling_loads(model.case, model.prepared.pairings):
        message = f"load {load} pulls {body} away from contact {contact}, which alone holds it"
        yield Check("pulled_apart", 1.0, message, "change its sign", f"load {load}")


def cut_bodies(model: Quality) -> Iterator[Check]:
    """Bodies cut at a plane of symmetry that touch one that is not."""
    for pairing in model.prepared.pairings:
        for (body, slave, _), other in zip(pairing.sides, pairing.bodies[::-1], strict=True):
            surface, models = pairing.surface_of(slave), model.prepared.models
            held, ends = model.prepared.held[body], () if surface.curve.closed else (False, True)
            planes = [end_of(models[body], surface, at, held, held)[1] for at in ends]
            near = (pairing.points if slave else pairing.partner)[np.argmin(pairing.gap)]
            inside = as_complex(surface.curve.points(np.array([0.5 * surface.curve.length])))
            for plane in planes if other != body else ():
                across = as_complex(models[other].cloud.points)
                if plane is None or abs(as_complex(near) - plane.point) > plane.reach:
                    continue
                behind = plane.height(across) * np.sign(plane.height(inside))
                if behind.min() < -ROUND_OFF * np.ptp(behind):
                    x, y = np.round(near / np.ptp(behind), 9) * np.ptp(behind) + 0.0
                    place = f"contact {pairing.name}"
                    message = (
                        f"{place}: body {body} ends at a side that is held as a plane of symmetry, and body "
                        f"{other} continues behind it, so that the edge of {body} at ({x:.6g}, {y:.6g}) "
                        f"presses on it"
                    )
                    yield Check("cut_body", 1.0, message, "cut both bodies at the plane, or neither", place)


def friction(model: Quality) -> Iterator[Check]:
    for contact in model.case.touching:
        place, value = f"contact {contact.name}", contact.friction
        if isinstance(value, float):
            message = f"{place}: friction = {value:g} is above all known coefficients"
            hint = f"if it is a percentage, use {value / 100.0:g}"
            yield Check("friction_coefficient", value, message, hint, place)


MODEL: Sequence[Callable[[Quality], Iterator[Check]]] = (
    *(clouds, facing_surfaces, bonded_curves, degree, initial_gap, loaded_length, load_resolution),
    *(weak_motions, corners, materials, pulled_apart, cut_bodies, friction),
)
"""Checks of a model."""
