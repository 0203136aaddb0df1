"""Boundaries of a case as pieces of the outline of a body: sides of one name, lists, parts. An outline has
one piece per smooth stretch. Boundaries of several pieces and parts of boundaries are sets of pieces;
supports and loads act on each piece. A contact joins its pieces to one surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate, pairwise

from mlsanm_cli.app.scene.boundary_parts import cuts_of
from mlsanm_cli.app.scene.boundary_runs import BoundaryRun, range_of, run_of
from mlsanm_cli.app.scene.outlines import drawn, numbers_of
from mlsanm_cli.case import Case, Place
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import chain_of, joined, part_of
from mlsanm_cli.cloud.surface import Surface, joined_surface


def curve_at(case: Case, place: Place, key: str) -> tuple[Curve, tuple[Curve, ...]]:
    """The curve of a side of a contact, and the other curves of the body's outline. Raises CaseError."""
    run = run_of(case, place, key)
    others = tuple(curve for k, curve in enumerate(run.outline.curves) if k not in run.numbers)
    own = joined(run.curves, run.around)
    if place.ends is not None:
        first, length = range_of(run, place)
        own = part_of(own, first, first + length)
    return own, others


def surface_at(case: Case, cloud: Cloud, place: Place, key: str) -> Surface:
    """A side of a contact as one surface. Raises CaseError if its pieces do not join."""
    run, names = run_of(case, place, key), surfaces_at(case, place)
    around = run.around and place.ends is None
    label = place.label.partition(".")[2]
    return joined_surface(label, [cloud.surfaces[name] for name in names], around)


@dataclass(frozen=True)
class SurfacePart:
    """A surface in a loaded region: the arc length ``first`` at its start, and the ``total`` of the
    region."""

    surface: Surface
    first: float
    total: float


def parts_at(case: Case, cloud: Cloud, place: Place) -> list[SurfacePart]:
    """The surfaces of a place with their arc lengths along it, also across pieces that do not join, in the
    order of the outline."""
    names = surfaces_at(case, place)
    surfaces = [cloud.surfaces[name] for name in names]
    starts = [*accumulate((surface.curve.length for surface in surfaces), initial=0.0)]
    return [SurfacePart(surface, start, starts[-1]) for surface, start in zip(surfaces, starts, strict=False)]


def surfaces_at(case: Case, place: Place) -> tuple[str, ...]:
    """The names of the surfaces of a place, in order along the outline."""
    body = next(one for one in case.body if one.name == place.body)
    if place.ends is None:
        outline = drawn(body.shape)
        numbers = [number for edge in place.edges for number in numbers_of(outline, edge)]
        found = chain_of(outline, numbers)
        ordered = sorted(set(numbers)) if found is None else found[0]
        run = BoundaryRun(outline, tuple(ordered), False)
        return tuple(name for _, name, _, _ in _pieces(case, place, run))
    run = run_of(case, place, "")
    first, length = range_of(run, place)
    whole = run.starts[-1]
    found_names = []
    for _, name, start, end in _pieces(case, place, run):
        away = (0.5 * (start + end) - first) % whole
        if away < length:
            found_names.append((away, name))
    return tuple(name for _, name in sorted(found_names))


def _pieces(case: Case, place: Place, run: BoundaryRun) -> Iterator[tuple[int, str, float, float]]:
    """Numbers, names, and arc lengths of start and end of the pieces of a run, cut like the outline."""
    body = next(one for one in case.body if one.name == place.body)
    cuts = cuts_of(case, body)
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        name, places = run.outline.names[number], sorted(cuts.get(number, ()))
        if not places:
            yield number, name, start, start + curve.length
            continue
        ends = [*places, places[0] + curve.length] if curve.closed else [0.0, *places, curve.length]
        for k, (first, last) in enumerate(pairwise(ends), start=1):
            yield number, f"{name}/{k}", start + first, start + last
