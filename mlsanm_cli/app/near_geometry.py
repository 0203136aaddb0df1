"""Where a contact may have a grid of its own: surfaces that face each other away from corners."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.contacts import shape_of
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.near import Facing
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.mechanics.body import BodyModel
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex
from mlsanm_cli.values import dataclass

CLEAR = 4.0
"""Pressures keep so many spacings off the ends of their surfaces: what is left of their fields then changes
over no less."""
TOUCHING = 1e-6
"""Gaps that differ by less than this part of the range are the same: such surfaces touch all along."""
APART = 3.0
"""Nodes farther apart along the surface than so many spacings are not neighbours."""
LOOKED_AT = 400
RAYS = 17
LOOKS = 8
CHORDS = 200


@dataclass(frozen=True)
class Clear:
    """A contact's range from ``first`` to ``last`` off all corners, the place ``nearest`` to the other
    surface, and where fields end in hollows."""

    facing: Facing
    first: float
    last: float
    nearest: float
    centers: tuple[complex | None, complex | None]


def clear_contacts(
    case: Case, models: Mapping[str, BodyModel], pairings: tuple[Pairing, ...]
) -> dict[str, Clear]:
    """The contacts that may have grids of their own, by name."""
    if case.mls.scheme != "least-squares" or case.solver.formulation != "condensed":
        return {}
    found = {pairing.name: _clear(case, models, pairing) for pairing in pairings}
    return {name: one for name, one in found.items() if one is not None}


def _clear(case: Case, models: Mapping[str, BodyModel], pairing: Pairing) -> Clear | None:
    if pairing.master_body == pairing.slave_body:
        return None
    if any(models[body].cloud.sight is not None for body in pairing.bodies):
        return None
    contact = next(one for one in case.contact if one.name == pairing.name)
    obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
    facing = Facing(pairing.slave.curve, None if pairing.master is None else pairing.master.curve, obstacle)
    if (np.diff(pairing.arc) > APART * np.maximum(pairing.spacing[1:], pairing.spacing[:-1])).any():
        return None
    s = np.linspace(pairing.arc[0], pairing.arc[-1], LOOKED_AT)
    off = _off_ends(pairing.slave, models[pairing.slave_body].cloud, s)
    if pairing.master is not None and pairing.master_body is not None:
        arc = pairing.master.curve.closest(facing.points(s))
        off &= _off_ends(pairing.master, models[pairing.master_body].cloud, arc)
    gap = facing.gap(s)
    nearest = int(np.argmin(gap))
    stretch = _stretch(off, nearest)
    if stretch is None:
        return None
    first, last = float(s[stretch[0]]), float(s[stretch[1]])
    least = gap[nearest] + TOUCHING * (last - first)
    if gap[stretch[0]] <= least or gap[stretch[1]] <= least:
        return None
    rays = np.linspace(first, last, RAYS)
    centers: list[complex | None] = []
    for body, slave in zip(pairing.bodies, (True, False), strict=False):
        found = void_center(models[body].cloud, *facing.side(rays, slave))
        if not found:
            return None
        centers += found
    closest = _minimum(facing, s[max(nearest - 1, 0)], s[min(nearest + 1, len(s) - 1)])
    return Clear(facing, first, last, closest, (centers[0], centers[1] if len(centers) > 1 else None))


def _minimum(facing: Facing, first: float, last: float) -> float:
    """Where between two places the gap is smallest, by ever finer looks."""
    for _ in range(LOOKS):
        s = np.linspace(first, last, RAYS)
        least = int(np.argmin(facing.gap(s)))
        first, last = s[max(least - 1, 0)], s[min(least + 1, len(s) - 1)]
    return 0.5 * float(first + last)


def _off_ends(surface: Surface, cloud: Cloud, arc: FloatArray) -> BoolArray:
    """Whether places at arc lengths (e,) are off the ends of a surface."""
    if surface.curve.closed:
        return np.ones(len(arc), dtype=bool)
    first, last = CLEAR * cloud.spacing[surface.index[[0, -1]]]
    return np.asarray((arc >= first) & (arc <= surface.curve.length - last))


def _stretch(chosen: BoolArray, inside: int) -> tuple[int, int] | None:
    """First and last of the run of ``chosen`` places that one lies in; None if it is none of them."""
    if not chosen[inside]:
        return None
    before, after = np.flatnonzero(~chosen[:inside]), np.flatnonzero(~chosen[inside:])
    first = int(before[-1]) + 1 if len(before) else 0
    last = inside + int(after[0]) - 1 if len(after) else len(chosen) - 1
    return (first, last) if last > first else None


def void_center(cloud: Cloud, place: ComplexArray, inward: ComplexArray) -> list[complex | None]:
    """Where the fields of forces at places (e,) of a body's outline end, [None] where the way outwards is free,
    and nothing where the void has no place that all of them see."""
    starts, ways, long = [], [], 0.0
    for surface in cloud.surfaces.values():
        arc = np.linspace(0.0, surface.curve.length, CHORDS + 1)
        points = as_complex(surface.curve.points(arc))
        starts.append(points[:-1])
        ways.append(np.diff(points))
        long = max(long, float(np.abs(ways[-1]).max()))
    start, way = np.concatenate(starts), np.concatenate(ways)
    free = _free(place, -inward, start, way, long)
    if np.isinf(free).all():
        return [None]
    middle = len(place) // 2
    center = complex(place[middle] - 0.5 * float(free.min()) * inward[middle])
    lines = center - place
    size = np.abs(lines)
    return [center] if (_free(place, lines / size, start, way, long) > size).all() else []


def _free(
    place: ComplexArray, ahead: ComplexArray, start: ComplexArray, way: ComplexArray, beside: float
) -> FloatArray:
    """How far (e,) one sees from places (e,) along unit directions ``ahead`` (e,) before the chords of the
    outline, from ``start`` along ``way`` (c,), come into view; not counting those ``beside`` the place."""
    across = (np.conj(ahead)[:, None] * way).imag
    apart = start - place[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.conj(apart) * way).imag / across
        share = -(np.conj(ahead)[:, None] * apart).imag / across
    hit = (across != 0.0) & (share >= 0.0) & (share <= 1.0) & (distance > beside)
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))
