"""Half of a body that is its own mirror image: nodes are placed there, the others are images."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.mirror import Line, Mirror
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.parts import cKDTree
from mlsanm_cli.values import dataclass

APART = 0.7
"""Nodes on the line are farther than this part of the spacing from those of the boundary."""
HEIGHT = 0.5 * np.sqrt(3.0)
"""Height of a triangle of three nodes equally far from each other, in spacings."""


@dataclass(frozen=True)
class Half:
    """What lies on one side of the ``line``: boundary nodes there and then ``upon`` nodes on it, ``start``
    (s, 2), and ``chords`` (c, 4) around it. ``image`` (b,) and ``side`` (b,) are those of all boundary nodes,
    ``surfaces`` their images."""

    line: Line
    start: FloatArray
    chords: FloatArray
    upon: int
    image: IntArray
    side: IntArray
    surfaces: Mapping[str, tuple[str, IntArray]]

    def mirror(self, count: int) -> Mirror:
        """The symmetry of ``count`` nodes: the boundary's, those on the line, those beside it, their
        images."""
        first = len(self.image) + self.upon
        beside, beyond = np.split(np.arange(first, count), 2)
        on = np.arange(len(self.image), first)
        image = np.concatenate([self.image, on, beyond, beside])
        side = [self.side, np.zeros_like(on), np.ones_like(beside), -np.ones_like(beyond)]
        return Mirror(self.line, image, np.concatenate(side), self.surfaces)


def halved(
    line: Line,
    boundary: FloatArray,
    edges: IntArray,
    surfaces: Mapping[str, Surface],
    spacing: Spacing,
) -> Half | None:
    """The half of the body whose ``boundary`` nodes (b, 2) are joined by ``edges`` (e, 2).

    None where they are not their own mirror images, or the line runs along the boundary.
    """
    image = line.images(boundary, spacing.at(boundary))
    if image is None:
        return None
    own = np.arange(len(boundary)) == image
    side = np.where(own, 0, np.sign(boundary[:, line.axis] - line.at)).astype(np.int64)
    images = _surface_images(image, surfaces)
    ends = side[edges]
    if images is None or (ends == 0).all(axis=1).any():
        return None
    crossing = ends.prod(axis=1) < 0
    if not np.array_equal(image[edges[crossing, 0]], edges[crossing, 1]):
        return None
    points = boundary[edges]
    middle = points.mean(axis=1)
    middle[:, line.axis] = line.at
    beside = (ends.sum(axis=1) > 0) | crossing
    outside = ends[:, :, None] < 0
    chords = np.where(outside, middle[:, None], points)[beside]
    along = 1 - line.axis
    crossed = np.concatenate([boundary[own, along], middle[crossing, along]])
    between = np.concatenate([np.zeros(own.sum(), dtype=bool), np.ones(crossing.sum(), dtype=bool)])
    order = np.argsort(crossed)
    if len(order) % 2:
        return None
    spans = np.split(order, len(order) // 2) if len(order) else []
    cuts = [_on(line, crossed[span]) for span in spans]
    nodes = [_between(spacing, cut, between[span], along) for cut, span in zip(cuts, spans, strict=True)]
    upon = np.concatenate([np.zeros((0, 2)), *nodes])
    upon = upon[cKDTree(boundary).query(upon)[0] > APART * spacing.at(upon)]
    start = np.concatenate([boundary[side >= 0], upon])
    walls = np.array(cuts).reshape(-1, 2, 2)
    chords = np.concatenate([chords, walls]).reshape(-1, 4)
    return Half(line, start, chords, len(upon), image, side, images)


def _on(line: Line, along: FloatArray) -> FloatArray:
    """Points (n, 2) on the line, by their other coordinate (n,)."""
    points = np.empty((len(along), 2))
    points[:, line.axis], points[:, 1 - line.axis] = line.at, along
    return points


def _between(spacing: Spacing, cut: FloatArray, between: FloatArray, along: int) -> FloatArray:
    """Nodes (n, 2) on a ``cut`` (2, 2) through the body, off its ends.

    An end ``between`` (2,) two boundary nodes is not one itself: the next one makes a triangle with them.
    """
    first, last = cut
    beyond = np.where(between, (1.0 - HEIGHT) * spacing.at(cut), 0.0)
    ends = cut.copy()
    ends[:, along] += np.array([-1.0, 1.0]) * beyond
    segment = Segment((float(ends[0, 0]), float(ends[0, 1])), (float(ends[1, 0]), float(ends[1, 1])))
    nodes = segment.points(spacing.steps_along(segment)[1:-1])
    inside = (nodes[:, along] > first[along]) & (nodes[:, along] < last[along])
    found: FloatArray = nodes[inside]
    return found


def _surface_images(
    image: IntArray, surfaces: Mapping[str, Surface]
) -> dict[str, tuple[str, IntArray]] | None:
    """The image of every surface and of its nodes (b,), by their places there; None where there are none."""
    places = {name: {int(node): k for k, node in enumerate(s.index)} for name, s in surfaces.items()}
    images = {}
    for name, surface in surfaces.items():
        seen = image[surface.index].tolist()
        other = next((o for o, known in places.items() if known.keys() == set(seen)), None)
        if other is None:
            return None
        images[name] = other, np.array([places[other][node] for node in seen], dtype=np.int64)
    return images
