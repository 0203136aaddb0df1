"""Lines of sight that cross a slit."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Bool2, Float1, Float2, Int1, Int2


@kernel
def cut_lines(
    starts: Float2,
    ends: Float2,
    numbers: Int2,
    edge_start: Int1,
    edge_numbers: Int1,
    edges: Float2,
    along: Float2,
    loop: Float1,
    normals: Float2,
    ratio: float,
) -> Bool2:
    """Mask (t, k) of the lines from ``starts`` (t, 2) to ``ends[numbers]``, ``numbers`` (t, k), cut by a
    slit.

    ``edges`` (e, 4) are the outline's chords; ``edge_numbers[edge_start[i] : edge_start[i + 1]]`` are those
    that lines from start i may meet. ``along`` (e, 2) are arc lengths at both ends of an edge, ``loop`` (e,)
    the length of its loop, ``normals`` (e, 2) its outward normal. All points lie inside, so that a line
    leaves and enters the body in turn. The void between is a slit if the way along the outline from one
    crossing to the other exceeds ``ratio`` times its width, measured along the normals if the two edges face
    each other, else along the line.
    """
    cut = np.zeros(numbers.shape, np.bool_)
    most = 0
    for i in range(starts.shape[0]):
        most = max(most, edge_start[i + 1] - edge_start[i])
    place = np.empty(most)
    way = np.empty(most)
    edge = np.empty(most, np.int64)
    for i in range(starts.shape[0]):
        x, y = starts[i, 0], starts[i, 1]
        for k in range(numbers.shape[1]):
            dx = ends[numbers[i, k], 0] - x
            dy = ends[numbers[i, k], 1] - y
            found = 0
            for m in range(edge_start[i], edge_start[i + 1]):
                e = edge_numbers[m]
                ax, ay = edges[e, 0] - x, edges[e, 1] - y
                bx, by = edges[e, 2] - x, edges[e, 3] - y
                first = dx * ay - dy * ax
                last = dx * by - dy * bx
                if (first > 0.0) == (last > 0.0):
                    continue
                part = first / (first - last)
                hit_x = ax + part * (bx - ax)
                hit_y = ay + part * (by - ay)
                t = (hit_x * dx + hit_y * dy) / (dx * dx + dy * dy)
                if not 0.0 < t < 1.0:
                    continue
                # Insertion sort of the crossings along the line.
                at = found
                while at > 0 and place[at - 1] > t:
                    place[at] = place[at - 1]
                    way[at] = way[at - 1]
                    edge[at] = edge[at - 1]
                    at -= 1
                place[at] = t
                way[at] = along[e, 0] + part * (along[e, 1] - along[e, 0])
                edge[at] = e
                found += 1
            for m in range(0, found - 1, 2):
                one, other = normals[edge[m]], normals[edge[m + 1]]
                apart = abs(way[m + 1] - way[m])
                apart = min(apart, loop[edge[m]] - apart)
                width = np.sqrt(dx * dx + dy * dy)
                if one[0] * other[0] + one[1] * other[1] < 0.0:
                    width = max(abs(dx * one[0] + dy * one[1]), abs(dx * other[0] + dy * other[1]))
                if apart > ratio * width * (place[m + 1] - place[m]):
                    cut[i, k] = True
    return cut
