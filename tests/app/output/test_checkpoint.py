"""A path taken up again behind any of its steps leads to the same states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import PathStep
from tests.app.scenes import (
    BAR,
    EXACT_LAW,
    FAST,
    NEWTON,
    SHEARED,
    SMOOTH,
    built,
    hertz,
)

INSIDE = "output.at=[0.3, 0.7, 1.0]"
SHORT = (FAST, "stage=[{press=1.0}, {shear=1.0}, {shear=1.0}, {shear=0.3}]", "output.at=[0.5, 1.5, 4.0]")
SCENES = {
    "linear": (BAR, ("output.at=[0.2, 0.6, 1.0]",)),
    "exact": (hertz(), (EXACT_LAW, FAST, "output.at=[0.25, 0.5, 1.0]")),
    "series": (
        hertz(),
        (*SMOOTH, "stage=[{press=0.6}, {press=0.6}, {press=1.0}]", "output.at=[0.3, 2.5, 3.0]"),
    ),
    "newton": (hertz(), (*SMOOTH, NEWTON, INSIDE)),
    "friction": (SHEARED, (*SMOOTH, *SHORT, "solver.tolerance=1e-10")),
    "exact friction": (SHEARED, (EXACT_LAW, *SHORT)),
}
SAME = 1e-8
"""How near states come where the path is followed in other steps; the solver's tolerance is 1e-6."""


def scene_of(name: str, directory: Path, *more: str) -> CondensedScene:
    text, settings = SCENES[name]
    return built(text, directory, *settings, *more)


def away(whole: list[PathStep], rest: list[PathStep]) -> float:
    """By how much the states asked for, and the last one, differ between two paths, relatively."""
    expected = {state.position: state for step in whole for state in (*step.saved, step.state)}
    found = [state for step in rest for state in step.saved] + [rest[-1].state]
    largest = 0.0
    for state in found:
        for name in ("pressure", "gap", "motion", "traction", "slip", "work", "displacement"):
            one, other = getattr(expected[state.position], name), getattr(state, name)
            size = max(float(np.abs(getattr(step.state, name)).max(initial=0.0)) for step in whole)
            largest = max(largest, float(np.nanmax(np.abs(one - other), initial=0.0)) / (size or 1.0))
    return largest


@pytest.mark.parametrize("name", SCENES)
def test_the_rest_of_a_path_leads_to_the_same_states(name: str, tmp_path: Path) -> None:
    scene = scene_of(name, tmp_path)
    whole = list(load_path(scene))
    assert len(whole) > 3
    middle = whole[len(whole) // 2].checkpoint
    assert middle is not None
    assert away(whole, list(load_path(scene, middle))) < SAME
    assert list(load_path(scene, whole[-1].checkpoint)) == []


def test_what_is_saved_leaves_the_path_alone(tmp_path: Path) -> None:
    """States within steps have tangents of their own: the path would continue from those, and count them.

    Both follow the path on the same contact grid, of which what is saved tells how fine it is.
    """
    few, many = "output.at=[2.0]", f"output.at={[k / 10 for k in range(1, 21)]}"
    short = ("stage=[{press=1.0}, {shear=0.5}]",)
    one, other = (scene_of("friction", tmp_path, *short, at) for at in (few, many))
    paths = [list(load_path(replace(one, case=two.case))) for two in (one, other)]
    ends = [[step.state.position for step in path] for path in paths]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


def test_a_path_that_ended_ends_there_again(tmp_path: Path) -> None:
    """Also where the last step's event left no state to continue from."""
    scene = scene_of("exact friction", tmp_path, "stage=[{press=1.0}, {shear=3.0}]", "output.at=[2.0]")
    steps: list[PathStep] = []
    with pytest.raises(NumericalError, match="slides as a whole"):
        steps.extend(load_path(scene))
    rest: list[PathStep] = []
    with pytest.raises(NumericalError, match="slides as a whole"):
        rest.extend(load_path(scene, steps[-1].checkpoint))
    assert all(abs(step.state.position - steps[-1].state.position) < 1e-9 for step in rest)
