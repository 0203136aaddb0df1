"""Parts of boundaries: outlines, and clouds from files, are cut at the ends of conditions on parts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.scene.boundary_runs import END_TOLERANCE, BoundaryRun, run_of
from mlsanm_cli.app.scene.contact_sides import sides_of
from mlsanm_cli.app.scene.load_profiles import profiles
from mlsanm_cli.app.scene.outlines import drawn, imported_geometry
from mlsanm_cli.case import Case, Displacement, Place, Platen, Pressure, Traction
from mlsanm_cli.case.model.case import Body
from mlsanm_cli.case.model.shapes import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.joined import cut
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.errors import CaseError, CaseProblem

MAX_END_DISTANCE = 0.1
"""Largest distance of the given end of a part from the boundary, relative to the boundary's length."""


def outline_of(case: Case, body: Body) -> Outline:
    """The outline of a body, cut at the ends of parts of boundaries. Raises CaseError for invalid parts."""
    return cut(drawn(body.shape), cuts_of(case, body))


def _partial_conditions(case: Case) -> Iterator[tuple[str, Place]]:
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
    """Arc lengths at which the curves of a body's original outline are cut, by curve number: at the ends of
    loaded, fixed and contacting parts, and where tractions are discontinuous."""
    cuts: dict[int, list[float]] = {}
    for key, place in _partial_conditions(case):
        if place.body != body.name:
            continue
        run = run_of(case, place, key)
        whole = run.starts[-1]
        assert place.ends is not None
        for name, end in zip(("from", "to"), place.ends, strict=True):
            at, away = run.nearest(end)
            if away > MAX_END_DISTANCE * whole:
                message = f"({end[0]:g}, {end[1]:g}) is {away:g} away from the boundary"
                raise CaseError((CaseProblem(f"{key}.{name}", message, hint="give a point on or near it"),))
            _add_cut(cuts, run, body, at)
        if run.range_of(place)[1] <= END_TOLERANCE * whole:
            message = "the part of the boundary between these points has no length"
            raise CaseError((CaseProblem(f"{key}.to", message, hint="give two different points"),))
    for load in case.load:
        if isinstance(load, Pressure | Traction) and load.owner == body.name:
            for profile in profiles(body.shape, load):
                whole = profile.run.starts[-1]
                for jump in profile.jumps:
                    _add_cut(cuts, profile.run, body, (profile.first + jump) % whole)
    return cuts


def _add_cut(cuts: dict[int, list[float]], run: BoundaryRun, body: Body, at: float) -> None:
    """Adds a cut of a run at an arc length (with given nodes: at the nearest one), unless it exists."""
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        if not start <= at <= start + curve.length:
            continue
        s = at - start
        if body.has_nodes:
            assert isinstance(body.shape, Mesh | Points)
            nodes = imported_geometry(body.shape).cloud.surfaces[run.outline.names[number]].arc_length
            s = float(nodes[np.argmin(np.abs(nodes - s))])
        small = END_TOLERANCE * curve.length
        known = [*cuts.get(number, ()), *(() if curve.closed else (0.0, curve.length))]
        if all(abs(s - other) > small for other in known):
            cuts.setdefault(number, []).append(s)
        return


def with_cuts(case: Case, body: Body, cloud: Cloud) -> Cloud:
    """A cloud from a file with its surfaces cut like the outline."""
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
    """Node positions of the parts of a surface cut at the nodes at arc lengths ``places``."""
    at = [int(np.argmin(np.abs(surface.arc_length - place))) for place in places]
    count = len(surface.index)
    if surface.curve.closed:
        return [[k % count for k in range(a, b + 1)] for a, b in pairwise([*at, at[0] + count])]
    return [list(range(a, b + 1)) for a, b in pairwise([0, *at, count - 1])]
