"""Fields of runs along boundaries and straight lines as pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.curves import curves_picture, run_names
from mlsanm_cli.app.results.fields import SCALARS, fields_at, inside, nodal, saved_state, scalar
from mlsanm_cli.app.results.marks import boundary_nodes
from mlsanm_cli.app.results.path_lookup import (
    level_at,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Place
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.curves import (
    Curve,
    Picture,
)
from mlsanm_cli.io.run_reader import RunData


def line_picture(runs: Sequence[RunData], cases: Sequence[Case], choice: Choice) -> Picture:
    """A field along a boundary such as ``block.top``, or along the straight line ``X,Y:X,Y``, at saved
    positions. Raises RunError for an invalid line, and for one that crosses no body."""
    assert choice.along is not None
    field = choice.field or "von_mises"
    curves = []
    for run, case, name in zip(runs, cases, run_names(runs), strict=True):
        for position in choice.at or (saved_state(run, None).position,):
            words = [name] if len(runs) > 1 else []
            words += [f"position {position:.4g}"] if len(choice.at) > 1 or len(runs) == 1 else []
            for where, x, y in _along(run, case, choice.along, field, position):
                curves.append(Curve(x, y, ", ".join([*words, where] if where else words)))
    units, label = cases[0].units, SCALARS[field].label
    along = "distance along the line" if ":" in choice.along else "arc length"
    labels = units.label(along, "length"), units.label(label, SCALARS[field].unit)
    return curves_picture(curves, *labels, f"{label[0].upper()}{label[1:]} along {choice.along}")


def _along(
    run: RunData, case: Case, along: str, field: str, position: float
) -> list[tuple[str, FloatArray, FloatArray]]:
    """For every body crossed: name, distances (k,) and values (k,), nan outside the body."""
    ends = along.split(":")
    if len(ends) == 1:
        return [("", *_on_boundary(run, case, along, field, position))]
    try:
        first, last = (np.array([float(part) for part in end.split(",")]) for end in ends)
        if first.shape != (2,) or last.shape != (2,) or not np.isfinite([first, last]).all():
            raise ValueError
    except ValueError:
        message = f'"{along}" is neither a boundary nor a line'
        raise RunError(message, "as in --along block.top or --along 0,0:0,-1") from None
    share = np.linspace(0.0, 1.0, 301)
    points = first + share[:, None] * (last - first)
    level = level_at(run, position)
    crossed = []
    for name, body in run.bodies.items():
        within = inside(body, points)
        if within.sum() < 2:
            continue
        ((seen, _),) = fields_at(run, case, name, points[within], [level])
        values = np.full(len(points), np.nan)
        values[within] = scalar(seen, field)
        crossed.append((name, share * float(np.hypot(*(last - first))), values))
    if not crossed:
        raise RunError(f"the line {along} crosses no body", "give coordinates of the undeformed bodies")
    return [("" if len(crossed) == 1 else name, x, y) for name, x, y in crossed]


def _on_boundary(
    run: RunData, case: Case, boundary: str, field: str, position: float
) -> tuple[FloatArray, FloatArray]:
    """Arc lengths (k,) and values (k,) at the nodes of a boundary."""
    name, _, edge = boundary.partition(".")
    body = run.bodies.get(name)
    edges = (
        [] if body is None else list(dict.fromkeys(piece.partition("/")[0] for piece in body.boundary.name))
    )
    if edge not in edges:
        known = ", ".join(f"{name}.{edge}" for edge in edges) or ", ".join(run.bodies)
        raise RunError(f'there is no boundary "{boundary}"', f"there are: {known}")
    assert body is not None
    index, _ = boundary_nodes(body, Place((boundary,)))
    values = scalar(nodal(run, case, saved_state(run, position), name), field)
    steps = np.hypot(*np.diff(body.points[index], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)]), values[index]
