"""Engines of other packages, against dense algebra and our own, on easy and on hard matrices.

Each is skipped where its package is not installed.
"""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.app.scene.assemble import assemble_bodies, prepare
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import load_case
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear import mumps, pardiso
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.operators.linear.engine import MissingEngineError, upper_triangle
from mlsanm_cli.operators.linear.interface import DirectSolver, Factor, Matrix, backward_error
from mlsanm_cli.operators.linear.mumps import MumpsFactor, MumpsSolver
from mlsanm_cli.operators.linear.pardiso import PardisoFactor, PardisoSolver
from mlsanm_cli.operators.linear.superlu import SuperLUFactor, SuperLUSolver
from tests.operators.test_cholesky import CASES, full, normal_equations, quasi_definite, scattered, star

Engine = Callable[[], DirectSolver]
OWN = (PardisoFactor, MumpsFactor)


def pardiso_or_skip() -> DirectSolver:
    try:
        return PardisoSolver()
    except MissingEngineError as error:
        pytest.skip(str(error))


def mumps_or_skip() -> DirectSolver:
    try:
        return MumpsSolver()
    except MissingEngineError as error:
        pytest.skip(str(error))


engines = pytest.mark.parametrize("make", [pardiso_or_skip, mumps_or_skip], ids=["pardiso", "mumps"])


@pytest.mark.parametrize("count", [1, 2, 40])
def test_the_upper_triangle_is_taken_of_columns_and_of_blocks(count: int) -> None:
    matrix = normal_equations(scattered(count))
    expected = np.triu(matrix.toarray())
    for one in (matrix, sparse.bsr_array(matrix, blocksize=(2, 2))):
        assert np.array_equal(upper_triangle(one).toarray(), expected)


@engines
@pytest.mark.parametrize("count", [1, 2, 40, 150])
def test_solutions_and_products_against_dense_ones(make: Engine, count: int) -> None:
    points, rng = scattered(count, count), np.random.default_rng(count)
    matrix = normal_equations(points, count)
    factor = make().factor_definite(matrix, points)
    assert isinstance(factor, OWN)
    for shape in ((2 * count,), (2 * count, 1), (2 * count, 5)):
        rhs = rng.normal(size=shape)
        kept = rhs.copy()
        expected = np.linalg.solve(matrix.toarray(), rhs)
        size = np.linalg.cond(matrix.toarray()) * np.abs(expected).max()
        found = factor.solve(rhs)
        assert np.array_equal(rhs, kept)
        assert found.flags.c_contiguous
        assert np.abs(found - expected).max() <= 1e-14 * size
        assert np.array_equal(found, factor.solve(rhs, transposed=True))
    left = sparse.csr_array(sparse.random_array((7, 2 * count), density=0.3, rng=rng))
    right = sparse.csc_array(sparse.random_array((2 * count, 90), density=0.3, rng=rng))
    expected = CholeskySolver().factor_definite(matrix, points).products(left, right)
    assert np.abs(factor.products(left, right) - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max())


@engines
@pytest.mark.parametrize("seed", range(3))
def test_quasi_definite_matrices_are_solved(make: Engine, seed: int) -> None:
    matrix, points, negative = quasi_definite(200, 12, seed)
    factor = make().factor_definite(matrix, points, negative)
    assert isinstance(factor, OWN)
    rhs = np.random.default_rng(seed).normal(size=(matrix.shape[0], 3))
    expected = np.linalg.solve(matrix.toarray(), rhs)
    assert np.abs(factor.solve(rhs) - expected).max() <= 1e-10 * np.abs(expected).max()


@engines
@pytest.mark.parametrize("apart", [1.0, 1e-3, 1e-6])
@pytest.mark.parametrize("scales", [0.0, 4.0, 8.0])
def test_hard_matrices_are_solved_as_well_as_by_superlu(make: Engine, apart: float, scales: float) -> None:
    points = scattered(400)
    scale = sparse.diags_array(10.0 ** np.random.default_rng(1).uniform(-scales, scales, 800))
    matrix = sparse.csc_array(scale @ normal_equations(points, apart=apart) @ scale)
    factor = make().factor_definite(matrix, points)
    assert isinstance(factor, OWN)
    other = SuperLUSolver().factor_definite(matrix, points)
    assert backward_error(matrix, factor) <= max(1e-16, 3.0 * backward_error(matrix, other))


@engines
@pytest.mark.parametrize("place", [scattered, lambda count: np.zeros((count, 2))], ids=["apart", "one place"])
@pytest.mark.parametrize(
    "matrix",
    [full(1), full(90), star(150), sparse.block_diag([full(7) for _ in range(20)], format="csc")],
    ids=["one node", "full", "star", "in pieces"],
)
def test_graphs_unlike_those_of_bodies(
    make: Engine, matrix: sparse.csc_array, place: Callable[[int], FloatArray]
) -> None:
    factor = make().factor_definite(matrix, place(matrix.shape[0] // 2))
    assert isinstance(factor, OWN)
    assert backward_error(matrix, factor) <= 1e-14


@engines
def test_other_sizes_are_refused(make: Engine) -> None:
    points = scattered(60)
    factor = make().factor_definite(normal_equations(points), points)
    assert factor.solve(np.zeros((120, 0))).shape == (120, 0)
    for size in (0, 118, 122):
        with pytest.raises(ValueError, match=f"{size} rows for 120 unknowns"):
            factor.solve(np.ones(size))
    for count in (59, 61):
        with pytest.raises(ValueError, match=f"a graph of 60 vertices for {count} points"):
            make().factor_definite(normal_equations(points), scattered(count))


@engines
def test_the_same_matrix_gives_the_same_bits(make: Engine) -> None:
    points, rhs = scattered(2000), np.random.default_rng(0).normal(size=(4000, 3))
    found = []
    for shift in range(4):
        # Elsewhere in memory, not always at multiples of 64 bytes.
        moved = np.empty(4000 * 3 + shift)[shift:].reshape(4000, 3)
        moved[:] = rhs
        found.append(make().factor_definite(normal_equations(points), points).solve(moved))
    assert all(np.array_equal(found[0], other) for other in found)


@engines
def test_several_factors_at_a_time_stay_apart(make: Engine) -> None:
    points = [scattered(count, count) for count in (300, 200, 250)]
    matrices = [normal_equations(one) for one in points]
    factors = [make().factor_definite(matrix, one) for matrix, one in zip(matrices, points, strict=True)]
    assert all(backward_error(*pair) <= 1e-14 for pair in zip(matrices, factors, strict=True))
    del factors[1], matrices[1]
    gc.collect()
    assert all(backward_error(*pair) <= 1e-14 for pair in zip(matrices, factors, strict=True))


@engines
def test_indefinite_matrices_are_left_to_superlu_and_noted(make: Engine) -> None:
    points = scattered(200)
    matrix = normal_equations(points) - 5.0 * sparse.eye_array(400)
    factor = make().factor_definite(sparse.csc_array(matrix), points)
    assert isinstance(factor, SuperLUFactor)
    assert "not positive definite" in factor.note


@engines
@pytest.mark.parametrize("value", [0.0, np.nan])
def test_a_matrix_that_nothing_can_factorise_is_refused(make: Engine, value: float) -> None:
    points = scattered(50)
    matrix = normal_equations(points).tolil()
    matrix[7, :] = value
    matrix[:, 7] = value
    with pytest.raises(NumericalError, match=r"could not be factorised|singular to working|failed"):
        make().factor_definite(sparse.csc_array(matrix), points)


def test_files_of_mumps_are_where_temporary_ones_belong_and_go_with_the_factor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, points = mumps_or_skip(), scattered(500)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv(mumps.DIRECTORY, "/elsewhere")
    factor = solver.factor_definite(normal_equations(points), points)
    (directory,) = tmp_path.iterdir()
    assert sum(file.stat().st_size for file in directory.iterdir()) >= 8 * 1000
    assert os.environ[mumps.DIRECTORY] == "/elsewhere"
    del factor
    gc.collect()
    assert not list(tmp_path.iterdir())


def test_a_directory_that_mumps_cannot_write_in_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, points = mumps_or_skip(), scattered(500)
    factorise = mumps._factor
    monkeypatch.setattr(tempfile, "mkdtemp", lambda **_: str(tmp_path / "gone"))
    with pytest.raises(NumericalError, match="MUMPS failed") as caught:
        factorise(normal_equations(points), 0)
    assert "TMPDIR" in caught.value.hint
    assert solver.name.startswith("mumps ")


@pytest.mark.parametrize("solver", [PardisoSolver, MumpsSolver])
def test_missing_packages_are_told(solver: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    pardiso._library.cache_clear()
    with pytest.raises(MissingEngineError, match="which is not installed") as caught:
        solver()
    assert caught.value.hint.startswith("pip install 'mlsanm[m")
    pardiso._library.cache_clear()


@dataclass
class Recorder:
    """Keeps every matrix and its factor."""

    solver: DirectSolver
    name: str = "recorder"
    kept: list[tuple[Matrix, FloatArray, Factor]] = field(default_factory=list)

    def factor_definite(self, matrix: Matrix, points: FloatArray, negative: int = 0) -> Factor:
        factor = self.solver.factor_definite(matrix, points, negative)
        self.kept.append((matrix, points, factor))
        return factor

    def __getattr__(self, name: str) -> object:
        return getattr(self.solver, name)


@engines
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_published_cases_are_solved_as_well_as_by_superlu(make: Engine, path: Path) -> None:
    case, recorder = load_case(path).case, Recorder(make())
    scene = assemble_bodies(case, prepare(case, clouds(case)), recorder)  # type: ignore[arg-type]
    systems = {id(body.system) for body in scene.bodies.values()}
    assert len(recorder.kept) == (len(systems) if case.mls.scheme == "least-squares" else 0)
    for matrix, points, factor in recorder.kept:
        assert isinstance(factor, OWN)
        other = SuperLUSolver().factor_definite(matrix, points)
        errors = [backward_error(matrix, one) for one in (factor, other)]
        assert errors[0] <= max(1e-16, 3.0 * errors[1])
