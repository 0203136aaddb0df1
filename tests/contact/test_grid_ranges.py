"""Where the nodes of a contact grid stand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.solve import grid_refinement
from mlsanm_cli.solve.grid_ranges import spaced_apart


def test_no_interval_is_round_off() -> None:
    # A range continued by whole steps came to its new end but for round-off: halving next to that interval
    # went on down to 1e-15, and a frame under a roller did not start.
    steps = np.arange(0.0, 0.9, 0.1)
    nodes = np.concatenate([[-1e-15], steps, [0.3 + 1e-12, 0.8 + 4e-16]])
    found = spaced_apart(nodes, 0.05)
    assert (found[0], found[-1]) == (nodes.min(), nodes.max())
    assert np.diff(found) == pytest.approx(np.full(8, 0.1))
    assert spaced_apart(np.array([0.0, 1e-9, 1.0]), 0.1).tolist() == [0.0, 1.0]


def test_grids_are_judged_state_by_state(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ends of contacts at other levels are no error of a level: fifty levels were refined seven times further
    than asked."""

    @dataclass(frozen=True)
    class Grid:
        hats: Hats
        first: float = -1.1
        last: float = 1.1

        def corners_of(self, slave: bool) -> tuple[()]:
            return ()

    grid = Grid(Hats(np.linspace(-1.1, 1.1, 221)))
    widths = np.linspace(0.5, 1.0, 21)
    states: list[Any] = [
        SimpleNamespace(pressure=np.sqrt(np.maximum(a**2 - grid.hats.place**2, 0.0))) for a in widths
    ]
    pairing = SimpleNamespace(grid=grid, friction=0.0)
    condensed: Any = SimpleNamespace(
        pairing_of=lambda name: pairing, spans={"c": slice(0, len(grid.hats.place))}
    )
    monkeypatch.setattr(grid_refinement, "summits", lambda *given: np.zeros(0))
    errors = [float(np.linalg.norm(grid_refinement.grid_errors(condensed, "c", [one]))) for one in states]
    worst = int(np.argmax(errors))

    def ends(aim: float) -> Any:
        grids: Any = {"c": grid}
        nothing: Any = {"c": None}
        found = grid_refinement.refined(condensed, grids, nothing, states, {"c": aim}, True)
        nodes = found["c"].hats.nodes
        return np.abs(nodes[~np.isclose(nodes[:, None], grid.hats.nodes).any(axis=1)])

    assert len(ends(1.01 * max(errors))) == 0
    assert np.linalg.norm(errors) > 2.5 * max(errors)
    assert ends(0.95 * max(errors)) == pytest.approx(widths[worst], abs=0.03)
