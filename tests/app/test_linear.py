"""``solver.linear``: what each choice gives, needs and says."""

from __future__ import annotations

from importlib import metadata, util
from pathlib import Path

import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.app.scene import size_estimate as estimate
from mlsanm_cli.case import load_case
from mlsanm_cli.cli import main
from mlsanm_cli.errors import CaseError
from mlsanm_cli.operators.linear import pardiso
from tests.app.scenes import BAR, NODAL, Quiet

NEEDS = {"pardiso": ("mkl", "mkl"), "mumps": ("mumps", "python-mumps")}
"""Module or library and package of each engine."""


def has(kind: str) -> bool:
    try:
        metadata.distribution(NEEDS[kind][1])
    except metadata.PackageNotFoundError:
        return False
    return kind == "pardiso" or util.find_spec(NEEDS[kind][0]) is not None


@pytest.mark.parametrize("kind", ["superlu", "pardiso", "mumps"])
def test_results_do_not_depend_on_who_factorises(kind: str, tmp_path: Path) -> None:
    if kind in NEEDS and not has(kind):
        pytest.skip(f"{NEEDS[kind][1]} is not installed")
    (tmp_path / "case.toml").write_text(NODAL)
    found = run(
        tmp_path / "case.toml",
        overrides=(f'solver.linear="{kind}"',),
        out=tmp_path / "out",
        console=Quiet(),
    )
    expected = run(tmp_path / "case.toml", out=tmp_path / "usual", console=Quiet())
    assert found["status"] == "done"
    assert found["warnings"] == expected["warnings"]
    for key in ("peak_pressure", "half_width"):
        there = expected["contacts"]["interface"][key]
        assert found["contacts"]["interface"][key] == pytest.approx(there, rel=1e-6)
    assert found["linear_residual"] <= 1e-7


@pytest.mark.parametrize(("kind", "extra"), [("pardiso", "mkl"), ("mumps", "mumps")])
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_package_that_is_missing(
    kind: str,
    extra: str,
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    (tmp_path / "case.toml").write_text(f'{BAR}\n[solver]\nlinear = "{kind}"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(metadata, "distribution", missing)
    pardiso._library.cache_clear()
    assert main([command, "case.toml"]) == 2
    err = capsys.readouterr().err
    line = (tmp_path / "case.toml").read_text().splitlines().index(f'linear = "{kind}"') + 1
    for part in (f"case.toml:{line}: solver.linear", "not installed", f"pip install 'mlsanm[{extra}]'"):
        assert part in err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]
    pardiso._library.cache_clear()


def test_memory_is_that_of_the_solver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "case.toml").write_text(BAR)
    kinds = ("mumps", "auto", "pardiso", "superlu")
    cases = {
        kind: load_case(tmp_path / "case.toml", (f'solver.linear="{kind}"', "body.bar.spacing=0.001")).case
        for kind in kinds
    }
    sizes = [estimate.estimate(case).memory_mb for case in cases.values()]
    assert sizes == sorted(set(sizes))
    monkeypatch.setattr(estimate, "physical_memory_mb", lambda: 0.5 * (sizes[0] + sizes[1]))
    with pytest.raises(CaseError, match="GB of memory") as caught:
        estimate.refuse_too_large(cases["auto"])
    assert caught.value.problems[0].key == "solver.linear"
    assert '"mumps"' in caught.value.problems[0].hint
    estimate.refuse_too_large(cases["mumps"])
    square = load_case(tmp_path / "case.toml", ('mls.scheme="collocation"', "body.bar.spacing=0.001")).case
    with pytest.raises(CaseError) as caught:
        estimate.refuse_too_large(square)
    assert caught.value.problems[0].key == "body.bar.spacing"
