"""Nodes with the largest violations of the contact laws in the last state of a failed run."""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

MAX_WORST_NODES = 10


Diagnosis = dict[str, FloatArray]
"""``pressure``, ``gap``, ``cone_ratio`` (traction over its limit, nan without friction) at every contact
node (m,), and ``residual``, the violation of the exact laws relative to peak pressure and elastic gap."""


def diagnose(built: CondensedScene, state: State) -> Diagnosis:
    """Diagnosis of the contact nodes of a state."""
    c, pressure, gap = built.condensed, state.pressure, state.gap
    peak = _largest(pressure)
    elastic = _largest(c.gap.pressure @ pressure)
    limit = c.friction * np.maximum(pressure[c.friction_nodes], 0.0)
    traction = np.abs(state.traction)
    ratio, beyond = np.full(len(pressure), np.nan), np.zeros(len(pressure))
    ratio[c.friction_nodes] = np.divide(traction, limit, out=np.full(len(limit), np.nan), where=limit > 0.0)
    beyond[c.friction_nodes] = np.maximum(traction - limit, 0.0)
    parts = (
        np.abs(c.gap(*state.unknowns) - gap) / elastic,
        np.maximum(-gap, 0.0) / elastic,
        np.maximum(-pressure, 0.0) / peak,
        beyond / peak,
        np.minimum(np.abs(pressure) / peak, np.abs(gap) / elastic),
    )
    residual = np.max(parts, axis=0) if len(pressure) else pressure
    return {"residual": residual, "pressure": pressure, "gap": gap, "cone_ratio": ratio}


def _worst(found: Diagnosis) -> list[int]:
    """Nodes in decreasing order of their residuals, nan first."""
    order = np.argsort(-np.nan_to_num(found["residual"], nan=np.inf), kind="stable")
    return [int(node) for node in order[:MAX_WORST_NODES]]


def worst_nodes(built: CondensedScene, found: Diagnosis) -> list[dict[str, Any]]:
    """Contact, position and values of the worst nodes."""
    rows = []
    for node in _worst(found):
        pairing = next(p for p in built.condensed.pairings if node < built.condensed.spans[p.name].stop)
        x, y = pairing.points[pairing.candidate][node - built.condensed.spans[pairing.name].start]
        values = {name: float(each[node]) for name, each in found.items()}
        rows.append({"contact": pairing.name, "x": float(x), "y": float(y), **values})
    return rows


def node_fields(built: CondensedScene, found: Diagnosis) -> dict[str, dict[str, FloatArray]]:
    """Nodal fields (n,) by body and name, nan off the slave surfaces; ``worst`` is the rank from 1, or 0."""
    rank, worst = np.zeros(len(found["residual"])), _worst(found)
    rank[worst] = 1.0 + np.arange(len(worst))
    fields: dict[str, dict[str, FloatArray]] = {}
    for body, elastic in built.scene.bodies.items():
        count = len(elastic.model.cloud.points)
        fields[body] = {name: np.full(count, np.nan) for name in found} | {"worst": np.zeros(count)}
        for pairing in built.condensed.pairings:
            if pairing.slave_body != body or pairing.grid is not None:
                continue
            nodes, span = pairing.node[pairing.candidate], built.condensed.spans[pairing.name]
            # A node of several contacts shows the one with the larger residual.
            worse = ~(found["residual"][span] <= fields[body]["residual"][nodes])
            for name, each in found.items():
                fields[body][name][nodes[worse]] = each[span][worse]
            fields[body]["worst"][nodes[worse]] = rank[span][worse]
    return fields


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max(initial=0.0)) or 1.0
