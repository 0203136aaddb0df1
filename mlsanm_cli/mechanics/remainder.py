"""Remainder of a body's response to surface forces: the response minus their closed-form near fields.

It is smooth at the forces, so that least squares on a cloud that does not resolve them suffices. Its data are
the negative tractions of the fields on the outline, their displacements where the body is held, both where
springs act, and their mean motion where nothing holds the body. Equation (6) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves, graded_quadrature
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import CorneredForces, Forces
from mlsanm_cli.mechanics.corner_faces import smooth_step
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.mechanics.pieces import Pieces
from mlsanm_cli.mechanics.supports import FREE, NO_SPRING
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

HELD_RANGE = 4.0
"""Distance, in spacings, within which forces next to a held node count as next to it."""
CORNER_HALVINGS = 14
"""Number of halvings of the half interval at a corner, towards the corner."""


def remainder_sources(
    body: ElasticBody,
    forces: Forces,
    centred: bool = True,
    pins: Mapping[int, FloatArray] = MappingProxyType({}),
) -> FloatArray:
    """Right-hand sides (r, 2k) of the remainders for unit forces: x at all k places, then y. If ``centred``,
    field and remainder together have zero mean free motion. ``pins`` are held nodes next to forces with the
    smooth part of the fields' displacements there (k, 2, 2): for the other part these nodes are displaced."""
    cloud, pieces = body.model.cloud, body.pieces
    count = len(forces.place)
    source = np.zeros((body.rows, count, 2))
    along = {name: _Outline(surface, forces) for name, surface in cloud.surfaces.items()}
    loads = _balancing(body, forces, along)
    for name, surface in cloud.surfaces.items():
        z, normal = as_complex(cloud.points[surface.index]), as_complex(surface.normal)
        values = -forces.traction(z, normal, surface.curve.curvature(surface.arc_length))
        held, springs = body.held.get(name, FREE), np.array(body.springs.get(name, NO_SPRING))
        if any(held) or springs.any():
            moved = forces.displacement(z)
            values -= springs[:, None] * moved
            values = np.where(np.array(held)[:, None], -moved, values)
        for component in (0, 1):
            source[body.condition_rows(name, component)] = values[:, :, component]
        # On the pieces, tractions of the fields and of springs where the surface is free.
        part, soft = along[name], np.array(body.soft_springs.get(name, NO_SPRING))
        left = -part.tractions
        if soft.any():
            left = left - soft[:, None] * forces.displacement(as_complex(part.points))
        free = ~np.array(body.restrained.get(name, FREE))
        loads += part.onto(pieces, np.where(free[:, None], left, 0.0))
    for node in dict.fromkeys(node for node, _ in body.held_nodes):
        felt = pins.get(node)
        if felt is None:
            # Of forces next to it at the nearest node inside: the reaction spreads over a spacing, and
            # displacements next to closer forces are unbounded.
            inside = np.delete(np.arange(len(cloud.points)), cloud.boundary_nodes)
            away = np.hypot(*(cloud.points[inside] - cloud.points[node]).T)
            z = as_complex(cloud.points[[node, inside[np.argmin(away)]]])
            here, within = forces.displacement(z)
            near = smooth_step(np.abs(forces.place - z[0]) / (HELD_RANGE * cloud.spacing[node]))
            near = near[:, None, None]
            felt = (1.0 - near) * here + near * within
        for component, row in body.pin_rows(node):
            source[row] = -felt[:, component]
    motions = len(body.free.components)
    if centred and motions:
        # Minus the mean free motions of the fields over the body.
        at, areas = graded_quadrature(cloud.points, cloud.triangles, as_real(forces.place))
        patterns = body.free.patterns(at).reshape(len(at), 2, motions)
        weighted = areas[:, None, None] * patterns
        gram = np.einsum("ecd,ecf->df", weighted, patterns)
        means = np.einsum("ecd,ekcf->dkf", weighted, forces.displacement(as_complex(at)), optimize=True)
        means = np.linalg.solve(gram, means.reshape(motions, -1)).reshape(means.shape)
        source[body.first_pin : body.first_pin + motions] = -means
    flat = source.reshape(body.rows, -1)
    missing = loads.reshape(3 * pieces.count, -1) - body.loads @ flat
    flat[body.rows - len(missing) :] = missing
    return np.ascontiguousarray(np.moveaxis(source, 2, 1)).reshape(body.rows, -1)


class _Outline:
    """Quadrature ``points`` (g, 2) along a surface, of ``nodes`` (g,), with weights ``length`` (g,), graded
    towards corners near which forces act, and the ``tractions`` (g, k, 2, 2) of the fields there."""

    def __init__(self, surface: Surface, forces: Forces) -> None:
        halves = Halves.of(surface, FINE)
        if isinstance(forces, CorneredForces) and not surface.curve.closed:
            halves = _graded(surface, halves)
        self.points, self.nodes = surface.curve.points(halves.arc), surface.index[halves.own]
        self.length, normal = halves.length, as_complex(surface.curve.normals(halves.arc))
        curvature = surface.curve.curvature(halves.arc)
        self.tractions = forces.traction(as_complex(self.points), normal, curvature)

    def onto(self, pieces: Pieces, density: FloatArray) -> FloatArray:
        """Force and moment (3p, k, 2) on the ``pieces`` by a ``density`` (g, k, 2, 2)."""
        force = self.length[:, None, None, None] * density
        return pieces.gathered(self.nodes, self.points, np.moveaxis(force, 2, 1))

    def resultant(self, density: FloatArray, center: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
        """Force and moment about ``center`` (3, k, 2, ...) of a ``density`` (g, k, 2, ...)."""
        arm = (self.points - np.array(center))[:, None]
        return np.asarray(_moment(arm, self.length[:, None, None, None] * density).sum(axis=1))


def _balancing(body: ElasticBody, forces: Forces, along: Mapping[str, _Outline]) -> FloatArray:
    """Loads of the pieces (3p, k, 2) that compensate the quadrature error of the tractions ``along`` all
    surfaces, distributed like a rigid motion along the loaded ones."""
    loaded, bearing = as_real(forces.place), []
    missing = -_moment(loaded, np.broadcast_to(np.eye(2), (len(loaded), 2, 2)))
    for name, part in along.items():
        missing -= part.resultant(part.tractions)
        curve = body.model.cloud.surfaces[name].curve
        away = curve.points(curve.closest(loaded)) - loaded
        if (np.abs(away) <= COARSE_ROUND_OFF * curve.length).all(axis=1).any():
            bearing.append((part.nodes, part.points, part.length))
    own, points, length = (np.concatenate(some) for some in zip(*bearing, strict=True))
    arm = points - points.mean(axis=0)
    shapes = np.zeros((len(points), 3, 2))
    shapes[:, 0, 0] = shapes[:, 1, 1] = 1.0
    shapes[:, 2] = np.stack([-arm[:, 1], arm[:, 0]], axis=1) / np.abs(arm).max()
    shapes *= length[:, None, None]
    sums = _moment(points, shapes.transpose(0, 2, 1)).sum(axis=1)
    share = np.linalg.solve(sums, missing.reshape(3, -1)).reshape(missing.shape)
    force = -np.einsum("esc,skf->ekcf", shapes, share)
    return body.pieces.gathered(own, points, np.moveaxis(force, 2, 1))


def _graded(surface: Surface, halves: Halves) -> Halves:
    """The quadrature points of a surface with those at its ends graded towards these."""
    arc, last = surface.arc_length, len(surface.index) - 1
    inner = (halves.own != 0) & (halves.own != last)
    crowd = np.concatenate([[0.0], 0.5 ** np.arange(CORNER_HALVINGS, -1, -1)])
    parts = [tuple(one[inner] for one in (halves.own, halves.other, halves.share, halves.arc, halves.length))]
    for own, other in ((0, 1), (last, last - 1)):
        way = 0.5 * (arc[other] - arc[own])
        for x, weight in FINE:
            at, size = crowd[:-1] + x * np.diff(crowd), weight * np.diff(crowd)
            same = np.full(len(at), own), np.full(len(at), other)
            parts.append((*same, 1.0 - 0.5 * at, arc[own] + at * way, size * abs(way)))
    return Halves(*(np.concatenate(some) for some in zip(*parts, strict=True)))


def reaction_of(body: ElasticBody, name: str, center: tuple[float, float], forces: Forces) -> FloatArray:
    """Force and moment about ``center`` (3, 2k) of a held surface, from the near fields of unit forces."""
    part = _Outline(body.model.cloud.surfaces[name], forces)
    held = np.array(body.restrained[name])[:, None]
    total = part.resultant(np.where(held, part.tractions, 0.0), center)
    return np.ascontiguousarray(np.moveaxis(total, 2, 1)).reshape(3, -1)


def spring_pull_of(body: ElasticBody, name: str, forces: Forces) -> FloatArray:
    """Force and moment (3, 2k) of a surface's soft springs, from the near fields of unit forces."""
    part, springs = _Outline(body.model.cloud.surfaces[name], forces), np.array(body.soft_springs[name])
    total = part.resultant(-springs[:, None] * forces.displacement(as_complex(part.points)))
    return np.ascontiguousarray(np.moveaxis(total, 2, 1)).reshape(3, -1)


def _moment(arm: FloatArray, force: FloatArray) -> FloatArray:
    """``force`` (..., 2, c) and its moment with ``arm`` (..., 2): (3, ..., c)."""
    x, y = force[..., 0, :], force[..., 1, :]
    return np.stack([x, y, arm[..., :1] * y - arm[..., 1:] * x])
