"""Where the nodes of a contact grid stand."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.solve.grid_ranges import _beside, _growing, spaced_apart


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
