"""The scenes of benchmarks/scenes: valid cases in all variants, judged without mercy."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from benchmarks.scenes import assemblies, profiles, wedges
from benchmarks.scenes.estimates import Compared
from benchmarks.scenes.every import SCENES
from benchmarks.scenes.judge import Ran, judged
from benchmarks.scenes.scene import Figure, Refusal, Scene, Table
from benchmarks.scenes.variants import LENGTH, STRESS, halved, variants
from mlsanm_cli.app.scene.imported import load_with_files
from mlsanm_cli.case.model.expressions import compile_expression

LEFT_OUT = tuple(one.__name__ for one in (assemblies, profiles, wedges))


def scenes() -> Iterator[Scene]:
    """All but a few; references of profiles take a second each."""
    for make in SCENES.values():
        if inspect.unwrap(make).__module__ not in LEFT_OUT and not (scene := make()).missing:
            yield scene


def test_scenes_and_their_variants_are_valid_cases(tmp_path: Path) -> None:
    for number, scene in enumerate(scenes()):
        far = 5e-4 if max(stiffnesses(scene.case)) > 1e8 else 0.5  # metres, and millimetres
        left = {"left": (0.2 * far, {(0.0, 0.0): 0.02 * far})}
        spacings = {one["name"]: (far, left) for one in scene.case["body"]}
        others = list(variants())
        # Each of them in turn, which takes a fraction of all for all.
        for variant in (others[number % len(others)], halved(scene.case, spacings)):
            for name, write in scene.files.items():
                write(tmp_path / name, variant.move())
            (tmp_path / "case.toml").write_text(tomli_w.dumps(variant.change(scene.case)))
            load_with_files(tmp_path / "case.toml")


def test_variants_come_back_to_the_scene() -> None:
    turned = next(one for one in variants() if one.name == "turned")
    scaled = next(one for one in variants() if one.name == "units")
    for scene in scenes():
        four = scene.case
        for _ in range(4):
            four = turned.change(four)
        for key in ("support", "contact"):
            assert [one.get("boundary") for one in four.get(key, [])] == [
                one.get("boundary") for one in scene.case.get(key, [])
            ]
        for was, now in zip(scene.case.get("load", []), four.get("load", []), strict=True):
            for key in ("ux", "uy", "fx", "fy"):
                assert now.get(key, np.nan) == pytest.approx(was.get(key, np.nan), nan_ok=True)
        assert stiffnesses(scaled.change(scene.case)) == pytest.approx(
            [STRESS * value for value in stiffnesses(scene.case)]
        )
    assert LENGTH * STRESS != 1.0  # forces change as well


def test_variants_carry_expressions_over() -> None:
    """Gaps, temperatures and prescribed displacements of a place, where the variant has it."""
    x, y = 0.3, -0.2
    given: Table = {
        "material": {},
        "body": [{"name": "a", "shape": {"kind": "rectangle", "x": [-1.0, 1.0], "y": [-1.0, 1.0]}}],
        "load": [
            {"name": "warm", "kind": "temperature", "body": "a", "temperature": "3*x - y**2"},
            {"name": "bend", "kind": "displacement", "boundary": "a.top", "displacement": ["x*y", 0.5]},
        ],
        "contact": [{"name": "c", "slave": "a.bottom", "gap": "x**2 + 0.1*y"}],
    }
    for variant in (one for one in variants() if one.name in ("turned", "mirrored", "units")):
        made = variant.change(given)
        there = tuple(variant.move()(np.array([[x, y]]))[0])
        warm, bend = made["load"]
        assert compile_expression(warm["temperature"])(*there) == pytest.approx(3 * x - y**2)
        moved = [compile_expression(str(one))(*there) for one in bend["displacement"]]
        assert moved == pytest.approx(variant.length * variant.matrix @ np.array([x * y, 0.5]))
        gap = compile_expression(made["contact"][0]["gap"])(*there)
        assert gap == pytest.approx(variant.length * (x**2 + 0.1 * y))


def stiffnesses(given: Table) -> list[float]:
    """All moduli of all materials."""
    keys = ("E", "E1", "E2", "E3", "G12")
    return [one[key] for one in given["material"].values() for key in keys if key in one]


CASE: Table = {"body": [{"name": "a"}], "contact": []}


@pytest.mark.parametrize(
    ("code", "got", "warnings", "outcome"),
    [
        (0, 1.005, [], "right"),
        (0, 1.02, [], "silently wrong"),
        (0, float("nan"), [], "silently wrong"),
        (0, 1.02, ["coarse"], "wrong with a warning"),
        (3, 1.0, [], "refused"),
        (70, 1.0, [], "crashed"),
    ],
)
def test_outcomes(tmp_path: Path, code: int, got: float, warnings: list[str], outcome: str) -> None:
    scene = Scene("one", "any", CASE, [Figure("force", lambda _: got, 1.0)])
    ran = Ran(code, {"warnings": warnings, "forces": {}, "contacts": {}}, "", tmp_path)
    assert judged(scene, ran).outcome == outcome


@pytest.mark.parametrize(
    ("code", "position", "reason", "outcome"),
    [
        (3, 1.5, "the contact slides as a whole", "right"),
        (3, 1.5, "singular tangent", "refused"),
        (3, 1.2, "the contact slides as a whole", "refused"),
        (0, 2.0, "end of the last stage", "silently wrong"),
    ],
)
def test_a_scene_without_equilibrium_must_be_refused_for_its_reason(
    tmp_path: Path, code: int, position: float, reason: str, outcome: str
) -> None:
    scene = Scene("one", "any", CASE, refusal=Refusal(("slide",), 1.5))
    ran = Ran(code, {"position": position, "stop_reason": reason}, "", tmp_path)
    assert judged(scene, ran).outcome == outcome


def test_estimates_are_judged_by_all_references() -> None:
    def verdict(told: float, *errors: float, unsure: float = 0.0) -> str:
        return Compared("force", told, errors, unsure).verdict

    assert verdict(0.01, 0.02) == verdict(0.01, 0.02, 0.005) == "right"
    assert [verdict(0.01, 0.04), verdict(0.01, 0.002), verdict(1e-4, 9e-4)] == ["low", "high", "small"]
    # References that disagree, and a finer run that does not know.
    assert verdict(0.01, 0.04, 0.02) == verdict(0.01, 0.04, unsure=0.02) == "unknown"
    assert verdict(0.01, 0.08, unsure=0.03) == "low"
