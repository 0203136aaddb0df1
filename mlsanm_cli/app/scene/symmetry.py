"""Scenes that are their own mirror images: half of the equations are enough for them.

Without friction a scene's state is unique, and that of a symmetric scene is symmetric itself. With friction
it need not be, and the condensed problem would have to know tractions across the mirror.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.app.scene.loads import Acting
from mlsanm_cli.app.scene.surfaces import outline_of
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import Case, Mesh, Points
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.mirror import SAME, Line, Mirror
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.mechanics.body import BodyModel
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.scene import Platen, RigidConstraint, RigidMotion
from mlsanm_cli.solve.load_factors import stage_factors
from mlsanm_cli.values import dataclass

SAMPLES = 33
EVEN = 1e-9
"""Loads and gaps differ from their images by less than this part of the largest."""


def line_of(case: Case) -> Line | None:
    """The line about which nodes are placed symmetrically: the middle of all bodies, if all are their own
    mirror images about it.

    Not so with friction, or other schemes than least squares: where symmetry does not save half of the work,
    errors that differ from side to side are the better ones, as they cancel in part.
    """
    if case.mls.scheme != "least-squares" or any(contact.friction for contact in case.contact):
        return None
    if any(isinstance(body.shape, Mesh | Points) for body in case.body):
        return None
    boxes = np.array([_box(outline_of(case, body)) for body in case.body])
    size = np.ptp(boxes.reshape(-1, 2), axis=0).max()
    middle = boxes.mean(axis=1)
    for axis in (0, 1):
        line = Line(axis, float(middle[0, axis]))
        same = np.abs(middle[:, axis] - line.at).max() <= SAME * size
        if same and all(spacing_of(case, body).symmetric(line) for body in case.body):
            return line
    return None


def _box(outline: Outline) -> FloatArray:
    """Lowest and highest coordinates (2, 2) of an outline."""
    fractions = np.linspace(0.0, 1.0, SAMPLES)
    points = np.concatenate([curve.points(curve.length * fractions) for curve in outline.curves])
    return np.array([points.min(axis=0), points.max(axis=0)])


@dataclass(frozen=True)
class Even:
    """What symmetry about a ``line`` makes of a scene: ``pairings`` with their images, ``rigid_constraints``
    that stay on it."""

    line: Line
    pairings: tuple[Pairing, ...]
    rigid_constraints: tuple[RigidConstraint, ...]


def even_scene(
    case: Case,
    models: Mapping[str, BodyModel],
    held: Mapping[str, Mapping[str, tuple[bool, bool]]],
    held_nodes: Mapping[str, tuple[tuple[int, int], ...]],
    acting: Acting,
    rigid_constraints: tuple[RigidConstraint, ...],
    pairings: tuple[Pairing, ...],
) -> Even | None:
    """The scene as symmetry has it, if all that acts on the bodies is its own mirror image all along the
    case's stages; None if not, or if its equations are not solved body by body."""
    # A symmetric body may buckle out of its symmetry.
    if case.solver.formulation != "condensed" or case.model.strain == "finite":
        return None
    mirrors: dict[str, Mirror] = {}
    for name, model in models.items():
        mirror = model.cloud.mirror
        if mirror is None or not _aligned(model.material):
            return None
        if not _alike(mirror, held[name]) or not _alike(mirror, acting.springs[name]):
            return None
        if any(mirror.side[node] for node, _ in held_nodes[name]):
            return None
        mirrors[name] = mirror
    stages = stage_factors(case)
    lines = {mirror.line for mirror in mirrors.values()}
    if len(lines) != 1 or not _even_loads(acting, mirrors, stages):
        return None
    line = lines.pop()
    if not all(_even_mover(mover, line, mirrors, stages) for mover in rigid_constraints):
        return None
    images = [_images(pairing, mirrors) for pairing in pairings]
    if any(image is None for image in images):
        return None
    return Even(
        line,
        tuple(p.with_images(image) for p, image in zip(pairings, images, strict=True) if image is not None),
        tuple(_upon(mover, line) for mover in rigid_constraints),
    )


def _aligned(material: PlaneMaterial) -> bool:
    """Whether a material is its own mirror image about lines along the axes."""
    stiffness, expansion = np.abs(material.stiffness), np.abs(material.expansion)
    straight = stiffness[:2, 2].max() <= EVEN * stiffness.max()
    return bool(straight and expansion[2] <= EVEN * expansion.max())


def _alike(mirror: Mirror, conditions: Mapping[str, tuple[float, float]]) -> bool:
    """Whether surfaces have the ``conditions`` that their images have."""
    return all(conditions.get(mirror.surfaces[name][0]) == value for name, value in conditions.items())


def _even_mover(
    mover: RigidConstraint, line: Line, mirrors: Mapping[str, Mirror], stages: FloatArray
) -> bool:
    """Whether a mover is its own image, and nothing drives it but along the line."""
    if isinstance(mover, Platen):
        images = {(body, mirrors[body].surfaces[name][0]) for body, name in mover.held}
        if images != set(mover.held):
            return False
        size = abs(mover.center[0]) + abs(mover.center[1]) + abs(line.at)
        if mover.turns and abs(mover.center[line.axis] - line.at) > SAME * size:
            return False
    return not any(
        (stages @ (motion.force if motion.prescribed is None else motion.prescribed)).any()
        for motion in mover.motions
        if _across(motion, line)
    )


def _across(motion: RigidMotion, line: Line) -> bool:
    """Whether a motion is not its own mirror image."""
    return motion.component != 1 - line.axis


def _upon(mover: RigidConstraint, line: Line) -> RigidConstraint:
    """The mover without unknown motions across the line: symmetry forbids them."""
    motions = tuple(
        replace(motion, prescribed=np.zeros_like(motion.force)) if _across(motion, line) else motion
        for motion in mover.motions
    )
    return replace(mover, motions=motions)


def _even_loads(acting: Acting, mirrors: Mapping[str, Mirror], stages: FloatArray) -> bool:
    """Whether the loads of each kind on each body add up to their own image, with all factors ``stages``."""
    for name, mirror in mirrors.items():
        forces = [(force.number, force.values) for force in acting.body_forces if force.body == name]
        if not _even_sum(forces, forces, mirror.image, mirror, stages):
            return False
        heat = [(one.number, one.values[:, None]) for one in acting.heatings if one.body == name]
        if not _even_sum(heat, heat, mirror.image, mirror, stages, signs=np.ones(1)):
            return False
        for surface, (image, places) in mirror.surfaces.items():
            for held in (False, True):
                one, other = (
                    [
                        (load.number, load.values)
                        for load in acting.surface_loads
                        if (load.body, load.surface, load.held) == (name, where, held)
                    ]
                    for where in (surface, image)
                )
                if not _even_sum(one, other, places, mirror, stages):
                    return False
    return True


def _even_sum(
    loads: list[tuple[int, FloatArray]],
    images: list[tuple[int, FloatArray]],
    places: IntArray,
    mirror: Mirror,
    stages: FloatArray,
    signs: FloatArray | None = None,
) -> bool:
    """Whether ``loads`` are what the mirror makes of the ``images``, whose node for each is at ``places``: it
    multiplies their components by ``signs`` (c,), by default those of vectors."""
    signs = mirror.line.signs if signs is None else signs
    for factors in stages:
        lack = np.zeros((len(places), len(signs)))
        for number, values in loads:
            lack += factors[number] * values
        for number, values in images:
            lack -= factors[number] * values[places] * signs
        sizes = [np.abs(factors[number] * values).max(initial=0.0) for number, values in loads + images]
        if np.abs(lack).max(initial=0.0) > EVEN * max(sizes, default=0.0):
            return False
    return True


def _images(pairing: Pairing, mirrors: Mapping[str, Mirror]) -> IntArray | None:
    """Where (w,) the image of every paired node stands among them; None where a contact is not its own."""
    mirror = mirrors[pairing.slave_body]
    where = np.full(len(mirror.image), -1)
    where[pairing.node] = np.arange(len(pairing.position))
    image = where[mirror.image[pairing.node]]
    if (image < 0).any():
        return None
    slack = EVEN * pairing.spacing
    gaps = np.abs(pairing.gap[image] - pairing.gap) <= slack
    normals = np.abs(pairing.normal[image] * mirror.line.signs - pairing.normal).max(axis=1) <= EVEN
    partners = np.abs(mirror.line.reflect(pairing.partner[image]) - pairing.partner).max(axis=1) <= slack
    return image if (gaps & normals & partners).all() else None
