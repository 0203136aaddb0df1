"""Operators kept between runs: the same bits, found only where nothing they come from has changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app import cache
from mlsanm_cli.app.run import run
from mlsanm_cli.cli import main
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.store import SUFFIX
from mlsanm_cli.operators.linear.cholesky import CholeskyFactor
from tests.app.scenes import BAR, PATCH, Quiet, assert_same_bits

ROUGH = PATCH.replace('master = "', 'friction = 0.3\nmaster = "')


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLSANM_CACHE_DIR", str(tmp_path / "cache"))


def figures(tmp_path: Path, text: str, *overrides: str, name: str = "run", on_disk: bool = True) -> list[int]:
    """Arrays found and made by a run that must end well."""
    (tmp_path / "case.toml").write_text(text)
    console = Quiet()
    summary = run(
        *(tmp_path / "case.toml",),
        overrides=overrides,
        out=tmp_path / name,
        force=True,
        console=console,
        cache=on_disk,
    )
    assert summary["status"] == "done"
    return [summary["cache"][key] for key in ("found", "made")] if on_disk else []


@pytest.mark.parametrize("text", [ROUGH, BAR], ids=["contact", "bar"])
def test_the_same_bits_without_with_a_new_and_with_a_full_cache(tmp_path: Path, text: str) -> None:
    figures(tmp_path, text, name="without", on_disk=False)
    assert not (tmp_path / "cache" / "operators").exists()
    found, made = figures(tmp_path, text, name="new")
    assert (found, made > 0) == (0, True)
    assert figures(tmp_path, text, name="full") == [made, 0]
    for name in ("new", "full"):
        assert_same_bits(tmp_path / "without", tmp_path / name)


@pytest.mark.usefixtures("by_nodes")
def test_only_what_has_changed_is_made_again(tmp_path: Path) -> None:
    assert figures(tmp_path, ROUGH) == [0, 4]  # two clouds, answers of two bodies
    for free in (
        "contact.interface.friction=0.4",
        "contact.interface.regularization.eta=1e-3",
        "load.press.fy=-100.0",
        "solver.order=12",
        "output.at=[0.5]",
    ):
        assert figures(tmp_path, ROUGH, free) == [4, 0], free
    # Without friction nodes are placed symmetrically; other elasticity leaves the clouds.
    assert figures(tmp_path, ROUGH, "contact.interface.friction=0.0") == [0, 4]
    assert figures(tmp_path, ROUGH, "material.steel.nu=0.29") == [2, 2]
    assert figures(tmp_path, ROUGH, "mls.degree=3") == [2, 2]
    # Other nodes inside the upper body do nothing to the lower one, other nodes on its surface do.
    assert figures(tmp_path, ROUGH, "body.upper.seed=1") == [2, 2]
    assert figures(tmp_path, ROUGH, "body.upper.spacing=0.24") == [1, 3]


@pytest.mark.usefixtures("by_nodes")
def test_what_is_observed_and_the_equations_themselves_count(tmp_path: Path) -> None:
    figures(tmp_path, ROUGH)
    probe = '[[probe]]\nname = "tip"\nbody = "upper"\npoint = [1.0, 1.5]\n'
    assert figures(tmp_path, f"{ROUGH}{probe}") == [2, 2]
    # Springs so stiff that they hold: they are in the lower body's rows and nowhere else.
    held = 'boundary = "lower.bottom"\nuy = 0.0'
    assert held in ROUGH
    for stiffness, known in (("1e9", [3, 1]), ("2e9", [3, 1]), ("1e9", [4, 0])):
        sprung = held.replace("uy = 0.0", f"spring = [0.0, {stiffness}]")
        assert figures(tmp_path, ROUGH.replace(held, sprung)) == known


@pytest.mark.usefixtures("by_nodes")
def test_a_load_of_another_magnitude_leaves_the_other_answers(tmp_path: Path) -> None:
    moved = ROUGH.replace("fy = -200.0", "uy = -0.001")
    assert figures(tmp_path, moved) == [0, 5]
    assert figures(tmp_path, moved, "load.press.uy=-0.0007") == [4, 1]


def test_what_is_found_is_not_solved_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    columns: list[int] = []
    products = CholeskyFactor.products

    def counted(self: CholeskyFactor, left: Any, right: Any) -> Any:
        columns.append(right.shape[1])
        return products(self, left, right)

    monkeypatch.setattr(CholeskyFactor, "products", counted)
    figures(tmp_path, ROUGH)
    assert sum(columns) > 20
    columns.clear()
    figures(tmp_path, ROUGH)
    assert not columns


def test_damaged_operators_are_made_again(tmp_path: Path) -> None:
    _, made = figures(tmp_path, ROUGH, name="first")
    entries = sorted((tmp_path / "cache" / "operators").rglob(f"*{SUFFIX}"))
    assert len(entries) == made
    for entry in entries:
        content = bytearray(entry.read_bytes())
        content[len(content) // 2] ^= 1
        entry.write_bytes(content)
    assert figures(tmp_path, ROUGH, name="second") == [0, made]
    assert_same_bits(tmp_path / "first", tmp_path / "second")
    assert figures(tmp_path, ROUGH) == [made, 0]


def test_other_code_threads_and_libraries_have_other_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    origins = {cache.origin(1), cache.origin(2)}
    monkeypatch.setattr(cache, "__version__", "99")
    origins.add(cache.origin(1))
    monkeypatch.setattr(cache, "_code", lambda: "other")
    origins.add(cache.origin(1))
    assert len(origins) == 4


def test_cache_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures(tmp_path, BAR)
    assert main(["cache", "info"]) == 0
    shown = capsys.readouterr().out
    assert str(tmp_path / "cache") in shown
    assert "1000" in shown
    assert main(["cache", "clear"]) == 0
    assert cache.info()["entries"] == 0


@pytest.mark.parametrize("text", ["much", "-1", "inf", "nan"])
def test_a_limit_that_is_no_size_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("MLSANM_CACHE_LIMIT_MB", text)
    with pytest.raises(RunError, match="MLSANM_CACHE_LIMIT_MB"):
        cache.limit_mb()
