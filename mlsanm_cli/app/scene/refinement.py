"""Refinement of the clouds of a scene, with plain values that a checkpoint keeps."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Refinement:
    """Refined clouds: ``zones`` around segments in addition to those of the case, the results of the
    ``passes`` so far, and the message of a pass that ``failed``, if one did.

    At finite strain only the ``knots`` of all sides of all contacts, arc lengths.
    """

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
        knots = [[np.asarray(arc).tolist() for arc in sides] for sides in self.knots]
        return {**vars(self), "zones": [_row(zone) for zone in self.zones], "knots": knots}


def _row(zone: Zone) -> list[float]:
    assert isinstance(zone.curve, Segment)
    return [*zone.curve.start, *zone.curve.end, zone.spacing, zone.radius, zone.growth]


def has_automatic_spacings(case: Case, names: Collection[str]) -> bool:
    """Whether the spacings of all bodies with these ``names`` are automatic."""
    return all(body.spacing == "auto" and not body.has_nodes for body in case.body if body.name in names)
