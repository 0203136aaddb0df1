"""Refinement of the clouds of a scene, and its plain values that a checkpoint keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.records import dataclass


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
