"""A path taken up again behind any of its steps goes on to the same bits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.scene.build import build_scene, condense_scene
from mlsanm_cli.case import load_case
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.packing import packed, unpacked
from mlsanm_cli.solve.checkpoint import Start
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.event_driven import FrictionMark
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.regularized_points import RubbingMark
from mlsanm_cli.solve.state import PathStep
from tests.app.scenes import BAR, COARSE, PATCH, Quiet, hertz
from tests.app.test_friction import EXACT, HOLONOMIC, SHEARED

INSIDE = "output.at=[0.3, 0.7, 1.0]"
SHORT = ("stage=[{press=1.0}, {shear=1.0}, {shear=1.0}, {shear=0.3}]", "output.at=[0.5, 1.5, 4.0]")
NEWTON, MONOLITHIC = 'solver.method="newton"', 'solver.formulation="monolithic"'
SCENES = {
    "linear": (BAR, ("output.at=[0.2, 0.6, 1.0]",)),
    "exact": (PATCH, ("output.at=[0.25, 0.5, 1.0]",)),
    "series": (
        hertz(),
        (INSIDE, "stage=[{press=0.6}, {press=0.6}, {press=1.0}]", "output.at=[0.3, 2.5, 3.0]"),
    ),
    "newton": (hertz(), (INSIDE, NEWTON)),
    "monolithic": (hertz(), (INSIDE, MONOLITHIC, *COARSE)),
    "polished": (hertz(), (INSIDE, "solver.polish=true")),
    "holonomic": (SHEARED, (HOLONOMIC, "stage=[{press=1.0, shear=1.0}]", "output.at=[0.7, 1.0]")),
    "friction": (SHEARED, SHORT),
    "friction by newton": (SHEARED, (NEWTON, *SHORT)),
    "exact friction": (SHEARED, (EXACT, *SHORT)),
    "polished friction": (SHEARED, ("solver.polish=true", *SHORT)),
}
EVERY = {
    "friction": 5,
    "friction by newton": 17,
    "polished friction": 11,
    "monolithic": 4,
    "holonomic": 5,
    "series": 4,
    "polished": 5,
    "newton": 3,
}
"""Only every so many steps are tried where there are many."""


def built_of(name: str, directory: Path, *more: str) -> CondensedScene:
    text, settings = SCENES[name]
    case = directory / "case.toml"
    case.write_text(text)
    loaded, clock, console = load_case(case, (*settings, *more)), Clock(), Quiet()
    return condense_scene(loaded.case, build_scene(loaded, clock, console), clock, console)


def bits(step: PathStep) -> bytes:
    """All of a step; reading back what its mark was packed from changes nothing."""
    return packed(step)


@pytest.mark.parametrize("name", SCENES)
def test_the_rest_of_a_path_is_the_same(name: str, tmp_path: Path) -> None:
    built = built_of(name, tmp_path)
    whole = list(load_path(built))
    assert len(whole) > 3
    expected = [bits(step) for step in whole]
    for count in range(1, len(whole) + 1, EVERY.get(name, 1)):
        rest = list(load_path(built, Start(count, packed(whole[count - 1].mark))))
        assert [bits(step) for step in rest] == expected[count:], f"behind step {count - 1}"


@pytest.mark.parametrize("name", ["series", "newton", "friction"])
def test_the_rest_of_a_path_has_the_steps_that_are_left(name: str, tmp_path: Path) -> None:
    built = built_of(name, tmp_path, "solver.max_steps=7")
    steps: list[PathStep] = []
    with pytest.raises(NumericalError, match="more than 7 steps") as whole:
        steps.extend(load_path(built))
    assert len(steps) == 8
    rest: list[PathStep] = []
    with pytest.raises(NumericalError) as again:
        rest.extend(load_path(built, Start(4, packed(steps[3].mark))))
    assert again.value.message == whole.value.message
    assert [bits(step) for step in rest] == [bits(step) for step in steps[4:]]


def test_what_is_saved_leaves_the_path_alone(tmp_path: Path) -> None:
    """States within steps have tangents of their own: the path would go on from those, and count them.

    Both follow the path on the same contact grid, of which what is saved tells how fine it is.
    """
    few, many = "output.at=[2.0]", f"output.at={[k / 10 for k in range(1, 21)]}"
    short = ("stage=[{press=1.0}, {shear=0.5}]",)
    one, other = (built_of("friction", tmp_path, *short, at) for at in (few, many))
    marks = [[packed(step.mark) for step in load_path(replace(one, case=two.case))] for two in (one, other)]
    assert marks[0] == marks[1]


def test_a_path_that_ended_ends_there_again(tmp_path: Path) -> None:
    """Also where the last step's event left no state to go on from."""
    built = built_of("friction", tmp_path, "stage=[{press=1.0}, {shear=3.0}]", "output.at=[2.0]")
    steps: list[PathStep] = []
    with pytest.raises(NumericalError, match="slides as a whole") as first:
        steps.extend(load_path(built))
    rest: list[PathStep] = []
    with pytest.raises(NumericalError) as second:
        rest.extend(load_path(built, Start(len(steps), packed(steps[-1].mark))))
    assert rest == []
    assert second.value.message == first.value.message


def forgetful(mark: FrictionMark | RubbingMark) -> FrictionMark | RubbingMark:
    if isinstance(mark, FrictionMark):
        return replace(mark, state=replace(mark.state, stick_reference=0.0 * mark.state.stick_reference))
    return replace(mark, stick_reference=0.0 * mark.stick_reference)


def test_a_mark_without_memory_leads_elsewhere(tmp_path: Path) -> None:
    """The slips at rest that a mark holds are needed."""
    for name, kind in (("exact friction", FrictionMark), ("friction", RubbingMark)):
        built = built_of(name, tmp_path)
        steps = list(load_path(built))
        count = max(k for k, step in enumerate(steps) if step.state.position <= 1.5) + 1
        mark = unpacked(kind, packed(steps[count - 1].mark))
        assert isinstance(mark, FrictionMark | RubbingMark)
        try:
            rest = list(load_path(built, Start(count, packed(forgetful(mark)))))
        except NumericalError:
            continue
        assert [bits(step) for step in rest] != [bits(step) for step in steps[count:]]
