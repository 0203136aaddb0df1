"""Refinement of the clouds of a scene: zones that approximate a wanted spacing, and plain values that a
checkpoint keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.records import dataclass

LIMIT = 24
SPACING_TOLERANCE = 1.25
"""Accepted ratio of actual to wanted spacing."""
SNAP_DISTANCE = 0.5
"""Zone centres closer to the symmetry line than this fraction of the wanted spacing are moved onto it."""


@dataclass(frozen=True)
class Refinement:
    """Refined clouds: ``zones`` around segments in addition to those of the case, the results of the
    ``passes`` so far, and the message of a pass that ``failed``, if one did. At finite strain only the
    ``knots`` of all sides of all contacts, arc lengths."""

    zones: tuple[Zone, ...] = ()
    passes: tuple[Mapping[str, Any], ...] = ()
    failed: str = ""
    knots: Sequence[Sequence[Any]] = ()

    @classmethod
    def read(cls, plain: Mapping[str, Any]) -> Refinement:
        """From its plain values."""
        zones = [Zone(Segment((a, b), (c, d)), *asked) for a, b, c, d, *asked in plain["zones"]]
        return cls(**{**plain, "zones": tuple(zones), "passes": tuple(plain["passes"])})

    @property
    def plain(self) -> dict[str, Any]:
        """Plain values; a zone is a row of start, end, spacing, radius and growth."""
        ends = [zone.curve.ends for zone in self.zones]
        asked = [(zone.spacing, zone.radius, zone.growth) for zone in self.zones]
        rows = [[*start, *end, *rest] for (start, end), rest in zip(ends, asked, strict=True)]
        knots = [[np.asarray(arc).tolist() for arc in sides] for sides in self.knots]
        return {**vars(self), "zones": rows, "knots": knots}


def cover(
    points: FloatArray,
    spacing: FloatArray,
    wanted: FloatArray,
    planned: Spacing,
    growth: float,
    line: SymmetryLine | None = None,
) -> tuple[Zone, ...]:
    """Circular refinement zones for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,). At
    most LIMIT zones, twice as many with a symmetry ``line``. Greedy: the node with the largest ratio of
    actual to wanted spacing becomes the centre of a zone, whose radius grows as long as most of the area
    inside wants that spacing; infinity wants nothing. ``planned`` is the spacing without these zones. With a
    ``line`` the zones are symmetric if ``planned`` and ``wanted`` are."""
    has, area, zones = planned.at(points), spacing**2, list[Zone]()
    for _ in range(LIMIT):
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
        added = tuple(Zone.around(place, h, radius, growth) for place in places)
        zones += added
        has = np.minimum(has, Spacing(planned.far, added).at(points))
    return tuple(zones)
