"""Where the nodes of a contact grid stand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.solve import grid_refinement
from mlsanm_cli.solve.grid_ranges import _beside, _growing, spaced_apart, summits, touching_first


def test_no_interval_is_round_off() -> None:
    # A range continued by whole steps came to its new end but for round-off: halving next to that interval
    # went on down to 1e-15, and a frame under a roller did not start.
    steps = np.arange(0.0, 0.9, 0.1)
    nodes = np.concatenate([[-1e-15], steps, [0.3 + 1e-12, 0.8 + 4e-16]])
    found = spaced_apart(nodes, 0.05)
    assert (found[0], found[-1]) == (nodes.min(), nodes.max())
    assert np.diff(found) == pytest.approx(np.full(8, 0.1))
    assert spaced_apart(np.array([0.0, 1e-9, 1.0]), 0.1).tolist() == [0.0, 1.0]


def test_ranges_grow_by_ever_longer_intervals() -> None:
    # A range narrowed to the tip of a leaf spring and widened again had 28,000 intervals as fine as the tip.
    places = _growing(45.0, 0.0016, 1.9)
    steps = np.diff(np.concatenate([[0.0], places, [45.0]]))
    assert len(places) <= 60
    assert steps[0] == pytest.approx(0.0016, rel=0.1)
    assert (steps[1:] <= 1.31 * steps[:-1]).all()
    assert steps.max() <= 1.9


def test_between_two_crests_nothing_is_halved() -> None:
    # A wavy strip pressed on its crests had 3,800 intervals, halved all along until each crest had some.
    assert np.flatnonzero(_beside(np.array([0, 30]), 60)).tolist() == [0, 1, 2, 29, 30, 31, 32]


@pytest.mark.parametrize("clear", [0.0, 0.05])
def test_summits_are_looked_at_where_they_may_overlap(clear: float) -> None:
    # Between places far apart displacements are unsure by more than a summit overlaps: one patch of ten of a
    # rough profile was missed.
    hats = Hats(np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.5, 0.8, 1.1, 1.4]))
    active = hats.place < 0.12
    moved = 0.3 * hats.place**2 + 0.2
    places = np.linspace(0.0, 1.4, 141)
    way = np.interp(places, hats.place, moved)
    drawn = np.where(np.abs(places - 0.9) < 0.015, clear - 1e-4 - way, 1.0)
    grid = SimpleNamespace(hats=hats, gap=np.zeros(len(moved)), facing=None)
    pairing = SimpleNamespace(grid=grid, arc=hats.place, candidate=np.ones(len(moved), dtype=bool))
    condensed: Any = SimpleNamespace(
        pairing_of=lambda name: pairing,
        spans={"c": slice(0, len(moved))},
        watched_of=lambda name: slice(0, 0),
        watched=lambda *state: np.zeros(0),
    )
    state: Any = SimpleNamespace(gap=moved, active=active, unknowns=())
    room: Any = SimpleNamespace(drawn_gaps=(places, drawn))
    found = summits(condensed, "c", room, [state])
    assert found == pytest.approx([] if clear else [0.89, 0.9, 0.91])


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


@pytest.mark.parametrize(("height", "seen"), [(0.0, [0.3]), (0.1, [])])
def test_contacts_begin_where_surfaces_touch_as_drawn(height: float, seen: list[float]) -> None:
    # The end of a ladder rolled away from there while it bent: the grid was narrow around the last contact,
    # and the path ended at its first step.
    places = np.linspace(0.0, 1.0, 101)
    facing = SimpleNamespace(gap=lambda s: height + (s - 0.3) ** 2)
    room: Any = SimpleNamespace(
        drawn_gaps=(places, facing.gap(places)), first=0.0, last=1.0, nearest=0.3, facing=facing
    )
    assert touching_first({"c": room}).get("c", np.zeros(0)).tolist() == seen
