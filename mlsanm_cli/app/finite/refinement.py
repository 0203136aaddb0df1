"""Nodes of contacts at finite strain, from a first run: pressures live at nodes, and only a run shows where
bodies touch and over which width.

Runs are repeated with finer nodes until all patches of contact have those that the contact's accuracy asks
for, or ``MOST`` times. Only contacts get them the spacings of whose bodies are left to us.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.patches import ACROSS, AT, Touched
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.app.scene.default_spacing import NODAL_BAND, NODAL_GROWTH
from mlsanm_cli.app.scene.symmetry import line_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.finite.exact import AnyContact
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.errors import CaseError, NumericalError

MOST = 3
"""Runs that are repeated at most."""
LARGEST, COARSER = 5000, 1.5
"""Nodes of a scene up to which contacts refine them, and how much coarser zones are tried where these would
be more."""
STRAIGHT = 1e-9
NO_ZONES = np.zeros((0, 5))


@dataclass(frozen=True)
class ContactPass:
    """What came of a run: the fewest nodes ``across`` a patch of each contact, the contacts' forces (2,) at
    the states wanted, by position, and whether it was ``done``."""

    nodes: int
    across: Mapping[str, int]
    forces: Mapping[str, Mapping[str, Sequence[float]]]
    done: bool = True


@dataclass(frozen=True)
class Refinement:
    """Segments and spacings of finer nodes, ``zones`` (z, 5), those of the run ``before``, what ``passes``
    have found, how finer nodes ``failed``, if they did, and whether there are ``fewer`` than asked for."""

    zones: FloatArray = field(default_factory=NO_ZONES.copy)
    before: FloatArray = field(default_factory=NO_ZONES.copy)
    passes: tuple[ContactPass, ...] = ()
    failed: str = ""
    fewer: bool = False

    @classmethod
    def read(cls, figures: Mapping[str, Any]) -> Refinement:
        """From the figures that a run has stored, if it has."""
        if "refinement" not in figures:
            return cls()
        stored = dict(figures["refinement"])
        zones, before = (np.array(stored.pop(name)).reshape(-1, 5) for name in ("zones", "before"))
        return cls(zones, before, tuple(ContactPass(**one) for one in stored.pop("passes")), **stored)

    @property
    def plain(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)

    @property
    def asked(self) -> tuple[Zone, ...]:
        """The zones of finer nodes."""
        return tuple(
            Zone(Segment((a, b), (c, d)), fine, NODAL_BAND * fine, NODAL_GROWTH)
            for a, b, c, d, fine in self.zones.tolist()
        )

    @property
    def warnings(self) -> Iterator[str]:
        """What users should know of it, usually nothing."""
        if self.failed:
            yield f"with finer nodes in contact the path stops, these are the ones before: {self.failed}"
        if self.fewer:
            yield (
                f"contacts have fewer nodes than their accuracy asks for, as more than {LARGEST} nodes would "
                "be needed: raise contact.accuracy, or refine where bodies touch with body.refine"
            )


def refined(
    scene: FiniteScene,
    touched: Touched,
    known: Refinement,
    failure: NumericalError | None,
    context: RunContext,
) -> tuple[Refinement, SceneModel] | None:
    """How the next run is to be refined, with its clouds; None where the last one is as it should be."""
    case, nodes = scene.case, scene.unknowns // 2
    if known.failed:
        return None
    if failure and known.passes and known.passes[-1].done:
        back = Refinement(known.before, passes=known.passes[:-1], failed=failure.message)
        return back, place(case, context, back.asked)
    passes = (*known.passes, ContactPass(nodes, touched.across, touched.forces, failure is None))
    zones = wanted_zones(scene, touched) if len(passes) <= MOST else NO_ZONES
    fewer = False
    while len(zones):
        found = Refinement(zones, known.zones, passes, fewer=fewer)
        try:
            finer = place(case, context, found.asked)
        except (NumericalError, CaseError):
            return None
        count = sum(len(model.cloud.points) for model in finer.models.values())
        if nodes < count <= LARGEST:
            return found, finer
        if count <= nodes or (fewer and nodes > LARGEST):
            return None
        zones, fewer = zones * [1.0, 1.0, 1.0, 1.0, COARSER], True
    return None


def wanted_zones(scene: FiniteScene, touched: Touched) -> FloatArray:
    """Segments and their spacings (z, 5) that contacts ask for; none where all have enough nodes."""
    own = [contact for contact in scene.contacts if _left_to_us(scene.case, contact)]
    if not any(contact.name in touched.coarse for contact in own):
        return NO_ZONES
    rows: list[FloatArray] = []
    for contact in (one for one in own if one.name in touched.spacing):
        for side, spacing in zip(contact.sides, touched.wanted(contact.name), strict=True):
            rows += _segments(side, spacing)
    found = np.array(rows).reshape(-1, 5)
    line = line_of(scene.case)
    if line is not None:
        image = np.hstack([line.reflect(found[:, :2]), line.reflect(found[:, 2:4]), found[:, 4:]])
        found = np.vstack([found, image])
    return found


def _left_to_us(case: Case, contact: AnyContact) -> bool:
    """Whether the spacings of all bodies of a contact are automatic."""
    names = {side.body for side in contact.sides}
    return all(one.spacing == "auto" and not one.has_nodes for one in case.body if one.name in names)


def _segments(side: ContactSide, spacing: FloatArray) -> Iterator[FloatArray]:
    """Rows (5,) of segments between nodes (c,) with finite ``spacing``; straight ones of one spacing are
    taken together."""
    last: FloatArray | None = None
    for one in range(side.count if side.around is not None else side.count - 1):
        other = (one + 1) % side.count
        row = np.array([*side.places[one], *side.places[other], min(spacing[one], spacing[other])])
        if not np.isfinite(spacing[[one, other]]).all():
            continue
        if last is not None and _continues(last, row):
            last[2:4] = row[2:4]
            continue
        if last is not None:
            yield last
        last = row
    if last is not None:
        yield last


def _continues(last: FloatArray, row: FloatArray) -> bool:
    """Whether a segment goes on with another one in its direction."""
    before, way = last[2:4] - last[:2], row[2:4] - row[:2]
    bend = before[0] * way[1] - before[1] * way[0]
    straight = abs(bend) <= STRAIGHT * float(np.hypot(*before) * np.hypot(*way))
    return straight and np.array_equal(last[2:4], row[:2]) and bool(last[4] == row[4])


def contact_errors(known: Refinement, touched: Touched) -> dict[str, float]:
    """By contact, the estimated error of its force, both components, over the largest force of all: what it
    has changed by from the run before, if there is one, and what its nodes are known to leave."""
    size = max((math.hypot(*f) for one in touched.forces.values() for f in one.values()), default=0.0)
    found = {}
    for name, across in touched.across.items():
        found[name] = AT * (ACROSS / across) ** 2
        before = known.passes[-1] if known.passes else None
        if before is None or name not in before.across or not size:
            continue
        ratio = (before.across[name] / across) ** 2
        changes = [
            math.dist(force, before.forces[name][at]) / size
            for at, force in touched.forces[name].items()
            if at in before.forces.get(name, {})
        ]
        if ratio < 1.0 and changes:
            found[name] = max(found[name], max(changes) * ratio / (1.0 - ratio))
    return found
