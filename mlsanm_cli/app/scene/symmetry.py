"""The line about which the nodes of a symmetric case are placed symmetrically."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.app.scene.outlines import imported_geometry
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Body, Case, Mesh, Points
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.roundoff import ROUND_OFF

SAMPLES = 33


def line_of(case: Case) -> SymmetryLine | None:
    """The symmetry line of all bodies, None if there is none. Not used with friction: there asymmetric
    errors cancel in part, and results are better."""
    if any(contact.friction for contact in case.contact):
        return None
    if any(isinstance(body.shape, Mesh | Points) and not body.has_nodes for body in case.body):
        return None
    boundaries = Boundaries.of(case)
    points = [_points(boundaries, body) for body in case.body]
    boxes = np.array([[some.min(axis=0), some.max(axis=0)] for some in points])
    size = np.ptp(boxes.reshape(-1, 2), axis=0).max()
    middle = boxes.mean(axis=1)
    for axis in (0, 1):
        line = SymmetryLine(axis, float(middle[0, axis]))
        same = np.abs(middle[:, axis] - line.at).max() <= ROUND_OFF * size
        if same and all(
            line.images(nodes, np.full(len(nodes), size / np.sqrt(len(nodes)))) is not None
            if body.has_nodes
            else spacing_of(case, boundaries, body).symmetric(line)
            for body, nodes in zip(case.body, points, strict=True)
        ):
            return line
    return None


def _points(boundaries: Boundaries, body: Body) -> FloatArray:
    """The nodes (n, 2) of a body from a file, or points along its outline."""
    if isinstance(body.shape, Mesh | Points):
        return imported_geometry(body.shape).points
    fractions = np.linspace(0.0, 1.0, SAMPLES)
    curves = boundaries.drawn[body.name].curves
    return np.concatenate([curve.points(curve.length * fractions) for curve in curves])
