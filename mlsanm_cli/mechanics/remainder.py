"""Remainder of a body's response to surface forces: the response minus their closed-form near fields.

The remainder is smooth at the forces, so that least squares on a cloud that does not resolve them suffices.
Its data are the negative tractions of the fields on the outline, their displacements where the body is held,
both where springs act, and their mean motion where nothing holds the body.

Equation (6) of docs/method.md.
"""

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
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING
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
    sent = {name: _tractions(one, forces, _halves(one, forces)) for name, one in cloud.surfaces.items()}
    loads = _balancing(body, forces, sent)
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
        loads += _on_pieces(body, name, surface, forces, sent[name])
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


def _on_pieces(
    body: ElasticBody, name: str, surface: Surface, forces: Forces, sent: FloatArray
) -> FloatArray:
    """Force and moment (3p, k, 2) on the pieces by the remainder's tractions on a surface, minus those of the
    fields, ``sent`` (g, k, 2, 2), and the springs' there."""
    restrained, springs = body.restrained.get(name, FREE), np.array(body.soft_springs.get(name, NO_SPRING))
    halves = _halves(surface, forces)
    points = surface.curve.points(halves.arc)
    values = -sent
    if springs.any():
        values = values - springs[:, None] * forces.displacement(as_complex(points))
    force = halves.length[:, None, None, None] * np.where(np.array(restrained)[:, None], 0.0, values)
    return body.pieces.gathered(surface.index[halves.own], points, np.moveaxis(force, 2, 1))


def _balancing(body: ElasticBody, forces: Forces, sent: Mapping[str, FloatArray]) -> FloatArray:
    """Loads of the pieces (3p, k, 2) that compensate the quadrature error of the tractions ``sent`` by
    surface, distributed like a rigid motion along the loaded surfaces."""
    loaded, bearing = as_real(forces.place), []
    missing = -_moment(loaded, np.broadcast_to(np.eye(2), (len(loaded), 2, 2)))
    for name, surface in body.model.cloud.surfaces.items():
        halves = _halves(surface, forces)
        points = surface.curve.points(halves.arc)
        missing -= _moment(points[:, None], halves.length[:, None, None, None] * sent[name]).sum(axis=1)
        away = surface.curve.points(surface.curve.closest(loaded)) - loaded
        if (np.abs(away) <= COARSE_ROUND_OFF * surface.curve.length).all(axis=1).any():
            bearing.append((surface.index[halves.own], points, halves.length))
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


def _halves(surface: Surface, forces: Forces) -> Halves:
    """Quadrature points along a surface, graded towards corners near which forces act."""
    halves = Halves.of(surface, FINE)
    if not isinstance(forces, CorneredForces) or surface.curve.closed:
        return halves
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


def _tractions(surface: Surface, forces: Forces, halves: Halves) -> FloatArray:
    """The fields' tractions (g, k, 2, 2) at the quadrature points of a surface."""
    z, normal = as_complex(surface.curve.points(halves.arc)), as_complex(surface.curve.normals(halves.arc))
    return forces.traction(z, normal, surface.curve.curvature(halves.arc))


def reaction_of(body: ElasticBody, name: str, center: tuple[float, float], forces: Forces) -> FloatArray:
    """Force and moment about ``center`` (3, 2k) of a held surface, from the near fields of unit forces."""
    surface, held = body.model.cloud.surfaces[name], np.array(body.restrained[name])
    halves = _halves(surface, forces)
    points = surface.curve.points(halves.arc)
    force = halves.length[:, None, None, None] * np.where(
        held[:, None], _tractions(surface, forces, halves), 0.0
    )
    total = _moment((points - np.array(center))[:, None], force).sum(axis=1)
    return np.ascontiguousarray(np.moveaxis(total, 2, 1)).reshape(3, -1)


def spring_pull_of(body: ElasticBody, name: str, forces: Forces) -> FloatArray:
    """Force and moment (3, 2k) of a surface's soft springs, from the near fields of unit forces."""
    surface, springs = body.model.cloud.surfaces[name], np.array(body.soft_springs[name])
    halves = Halves.of(surface, FINE)
    points = surface.curve.points(halves.arc)
    moved = forces.displacement(as_complex(points))
    pull = -halves.length[:, None, None, None] * springs[:, None] * moved
    total = _moment(points[:, None], pull).sum(axis=1)
    return np.ascontiguousarray(np.moveaxis(total, 2, 1)).reshape(3, -1)


def _moment(arm: FloatArray, force: FloatArray) -> FloatArray:
    """``force`` (..., 2, c) and its moment with ``arm`` (..., 2): (3, ..., c)."""
    x, y = force[..., 0, :], force[..., 1, :]
    return np.stack([x, y, arm[..., :1] * y - arm[..., 1:] * x])
