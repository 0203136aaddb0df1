"""Parts of boundaries: where outlines, and clouds that came with them, are cut for conditions on parts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.scene.boundary_runs import AT_END, BoundaryRun, range_of, run_of
from mlsanm_cli.app.scene.contact_sides import sides_of
from mlsanm_cli.app.scene.load_profiles import profiles
from mlsanm_cli.app.scene.outlines import drawn, imported_geometry
from mlsanm_cli.case import Case, Displacement, Place, Platen, Pressure, Traction
from mlsanm_cli.case.model.case import Body
from mlsanm_cli.case.model.files import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.joined import cut
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.errors import CaseError, CaseProblem

FAR = 0.1
"""The ends of a part of a boundary are within this part of its length of it."""


def outline_of(case: Case, body: Body) -> Outline:
    """The body's outline, cut where parts of boundaries begin and end.

    Raises CaseError for parts without sense.
    """
    return cut(drawn(body.shape), cuts_of(case, body))


def _parted(case: Case) -> Iterator[tuple[str, Place]]:
    """Keys and places of all conditions on parts of boundaries."""
    for index, support in enumerate(case.support):
        if support.place is not None and support.ends is not None:
            yield f"support.{index}", support.place
    for load in case.load:
        if isinstance(load, Platen | Pressure | Traction | Displacement) and load.ends is not None:
            yield f"load.{load.name}", load.place
    for contact in case.contact:
        for place in sides_of(case, contact):
            if place.ends is not None:
                yield f"contact.{contact.name}", place


def cuts_of(case: Case, body: Body) -> dict[int, list[float]]:
    """Where the curves of a body's outline as drawn are cut, by their numbers: at the ends of parts that are
    loaded, held or in contact, and where tractions jump."""
    cuts: dict[int, list[float]] = {}
    for key, place in _parted(case):
        if place.body != body.name:
            continue
        run = run_of(case, place, key)
        whole = run.starts[-1]
        assert place.ends is not None
        for name, end in zip(("from", "to"), place.ends, strict=True):
            at, away = run.nearest(end)
            if away > FAR * whole:
                message = f"({end[0]:g}, {end[1]:g}) is {away:g} away from the boundary"
                raise CaseError((CaseProblem(f"{key}.{name}", message, hint="a point on it, or near it"),))
            _add_cut(cuts, run, body, at)
        if range_of(run, place)[1] <= AT_END * whole:
            message = "the part of the boundary between these points has no length"
            raise CaseError((CaseProblem(f"{key}.to", message, hint="two points apart"),))
    for load in case.load:
        if isinstance(load, Pressure | Traction) and load.owner == body.name:
            for profile in profiles(body.shape, load):
                whole = profile.run.starts[-1]
                for jump in profile.jumps:
                    _add_cut(cuts, profile.run, body, (profile.first + jump) % whole)
    return cuts


def _add_cut(cuts: dict[int, list[float]], run: BoundaryRun, body: Body, at: float) -> None:
    """Cut a run at an arc length, at a node if the nodes are there already, unless it is cut there."""
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        if not start <= at <= start + curve.length:
            continue
        s = at - start
        if body.has_nodes:
            assert isinstance(body.shape, Mesh | Points)
            nodes = imported_geometry(body.shape).cloud.surfaces[run.outline.names[number]].arc_length
            s = float(nodes[np.argmin(np.abs(nodes - s))])
        small = AT_END * curve.length
        known = [*cuts.get(number, ()), *(() if curve.closed else (0.0, curve.length))]
        if all(abs(s - other) > small for other in known):
            cuts.setdefault(number, []).append(s)
        return


def with_cuts(case: Case, body: Body, cloud: Cloud) -> Cloud:
    """A cloud whose nodes came with the body, with its surfaces cut as the outline is."""
    cuts = cuts_of(case, body)
    if not cuts:
        return cloud
    outline = drawn(body.shape)
    surfaces: dict[str, Surface] = {}
    for number, name in enumerate(outline.names):
        whole, places = cloud.surfaces[name], sorted(cuts.get(number, ()))
        if not places:
            surfaces[name] = whole
            continue
        parts = cut(Outline((name,), (whole.curve,)), {0: places})
        for own, curve, nodes in zip(parts.names, parts.curves, _split(whole, places), strict=True):
            arc = whole.arc_length[nodes] - whole.arc_length[nodes[0]]
            arc = np.mod(arc, whole.curve.length)
            surfaces[own] = Surface(own, curve, whole.index[nodes], arc, whole.normal[nodes])
    return Cloud(cloud.points, cloud.spacing, surfaces, cloud.mirror)


def _split(surface: Surface, places: Sequence[float]) -> list[list[int]]:
    """The nodes of the parts of a surface cut at nodes at arc lengths ``places``."""
    at = [int(np.argmin(np.abs(surface.arc_length - place))) for place in places]
    count = len(surface.index)
    if surface.curve.closed:
        return [[k % count for k in range(a, b + 1)] for a, b in pairwise([*at, at[0] + count])]
    return [list(range(a, b + 1)) for a, b in pairwise([0, *at, count - 1])]
