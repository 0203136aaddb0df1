"""Boundaries of a case as pieces of the outline of a body: sides of one name, lists, parts. An outline has
one piece per smooth stretch. Boundaries of several pieces and parts of boundaries are sets of pieces;
supports and loads act on each piece. A contact joins its pieces to one surface."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise

from mlsanm_cli.app.scene.boundary_parts import cuts_of
from mlsanm_cli.app.scene.boundary_runs import BoundaryRun, chains_at, run_of
from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.case import Case, Place
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.surface import Surface, joined_surface


def curve_at(case: Case, place: Place, key: str) -> tuple[Curve, tuple[Curve, ...]]:
    """The curve of a side of a contact, and the other curves of the body's outline. Raises CaseError."""
    run = run_of(case, place, key)
    others = tuple(curve for k, curve in enumerate(run.outline.curves) if k not in run.numbers)
    return run.part(place), others


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
    outline, cuts = drawn(body.shape), cuts_of(case, body)
    chains = chains_at(outline, place.edges)
    # Loaded and held boundaries need not join.
    numbers = chains[0][0] if len(chains) == 1 else sorted(number for chain, _ in chains for number in chain)
    run = BoundaryRun(outline, tuple(numbers), chains[0][1])
    first, length = run.range_of(place)
    found = []
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        name, places = outline.names[number], sorted(cuts.get(number, ()))
        ends = (
            [*places, places[0] + curve.length] if places and curve.closed else [0.0, *places, curve.length]
        )
        for k, (low, high) in enumerate(pairwise(ends), start=1):
            away = (start + 0.5 * (low + high) - first) % run.starts[-1]
            found.append((away, f"{name}/{k}" if places else name))
    if place.ends is None:
        return tuple(name for _, name in found)
    return tuple(name for away, name in sorted(found) if away < length)
