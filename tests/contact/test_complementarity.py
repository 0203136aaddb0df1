"""The complementarity problem of contact with friction: states, invariances, paths and limit loads."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.random_complementarity import KINDS, Example
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis, Ray, SingularError
from mlsanm_cli.contact.complementarity.equilibrium import equilibrium, undetermined
from mlsanm_cli.contact.complementarity.history import follow, increment, unloaded
from mlsanm_cli.contact.complementarity.problem import ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import State, solve


@pytest.mark.parametrize("kind", KINDS)
def test_small_problems_have_the_states_that_enumeration_finds(kind: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        example = Example.random(rng, kind)
        exists, x = bool(example.states()), example.solved(rng)
        assert (x is not None) == exists
        assert x is None or example.accepts(x, 1e-7)


def _block(friction: float) -> tuple[Problem, FloatArray, FloatArray]:
    """A block on two nodes with compliance, pressed by 1, then pushed by a growing force at its top."""
    x = np.array([-1.0, 1.0])
    gap = np.stack([np.zeros(2), np.ones(2), x], axis=1)
    slip = np.stack([np.ones(2), np.zeros(2), np.zeros(2)], axis=1)
    moved = np.vstack([gap, slip])
    matrix = np.block([[1e-3 * np.eye(4), moved], [-moved.T, np.zeros((3, 3))]])
    problem = Problem.of(matrix, np.arange(2), np.full(2, friction), 2)
    weight, push = np.zeros(7), np.zeros(7)
    weight[5], push[4], push[6] = 1.0, -1.0, 1.0
    return problem, problem.rows * weight, problem.rows * push


def _loaded(problem: Problem, state: State, free: FloatArray, lam: float) -> State:
    found = increment(problem, state, free, lam)
    assert found is not None
    return found


def _followed(problem: Problem, state: State, constant: FloatArray, load: FloatArray, end: float) -> State:
    for found in follow(problem, state, constant, load, [end]):
        state = found
    return state


@pytest.mark.parametrize(("friction", "limit", "moves"), [(0.4, 0.4, 0), (1.3, 1.0, 2)])
def test_a_pushed_block_slides_or_tips_at_its_limit_load(friction: float, limit: float, moves: int) -> None:
    problem, weight, push = _block(friction)
    state = _loaded(problem, unloaded(problem, np.zeros(7)), weight, 0.0)
    with pytest.raises(Ray) as caught:
        _followed(problem, state, weight, push, 2.0)
    assert caught.value.lam == pytest.approx(limit, rel=1e-9)
    motion = np.abs(caught.value.direction[4:] * problem.columns[4:])
    assert motion[moves] > 0.1 * motion.max()
    assert (motion[2] > 1e-9 * motion.max()) == (moves == 2)
    static = equilibrium(problem.matrix[4:], problem.nodes, problem.friction, weight[4:], 2.0 * push[4:])
    assert static is not None
    assert 2.0 * static[0] == pytest.approx(limit, rel=1e-9)


def _drawn(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A matrix of four nodes with friction and two motions, and rows of a constant and a growing load."""
    rng = np.random.default_rng(seed)
    square, moved = rng.normal(size=(8, 8)), rng.normal(size=(8, 2))
    moved[:4, 0] = 1.0
    matrix = np.block([[square @ square.T + np.eye(8), moved], [-moved.T, np.zeros((2, 2))]])
    pressed, pushed = rng.uniform(0.0, 0.3, 10), np.zeros(10)
    pressed[4:8], pressed[8:], pushed[8:] = 0.0, [4.0, 0.0], 2.0 * rng.normal(size=2)
    return matrix, pressed, pushed


def _variants() -> dict[str, tuple[FloatArray, FloatArray]]:
    """Maps (10, 10) of rows and of unknowns: others in their order, sides, units or axes."""
    order, mirror, axes = np.eye(10), np.eye(10), np.eye(10)
    order[:4], order[4:8] = order[[2, 0, 3, 1]], order[[6, 4, 7, 5]]
    mirror[4:8, 4:8] *= -1.0
    axes[8:, 8:] = [[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]]
    lengths, forces = np.repeat([1e-3, 1e3], [8, 2]), np.repeat([1e-6, 1e-3], [8, 2])
    return {
        "order": (order, order),
        "sides": (mirror, mirror),
        "axes": (axes, axes),
        "units": (np.diag(lengths), np.diag(forces)),
    }


@pytest.mark.parametrize(("rows", "unknowns"), _variants().values(), ids=_variants())
@pytest.mark.parametrize("seed", range(6))
def test_paths_do_not_depend_on_order_sides_axes_and_units(
    seed: int, rows: FloatArray, unknowns: FloatArray
) -> None:
    matrix, pressed, pushed = _drawn(seed)
    found = list[tuple[float, FloatArray, list[int]]]()
    for left, right in ((np.eye(10), np.eye(10)), (rows, unknowns)):
        problem = Problem.of(left @ matrix @ np.linalg.inv(right), np.arange(4), np.full(4, 0.4), 4)
        constant, load = problem.rows * (left @ pressed), problem.rows * (left @ pushed)
        state, end = _loaded(problem, unloaded(problem, 0.0 * load), constant, 0.0), 1.0
        try:
            state = _followed(problem, state, constant, load, 1.0)
        except Ray as ray:
            end = ray.lam
        counts = np.bincount(state.status.status(problem.nodes), minlength=3).tolist()
        found.append(
            (end, np.asarray(np.linalg.solve(right, problem.columns * state.x), dtype=float), counts)
        )
    (end, x, counts), (other, y, same) = found
    assert other == pytest.approx(end, rel=1e-8)
    assert np.abs(y - x).max() <= 1e-8 * np.abs(x).max()
    assert same == counts


def test_friction_remembers_a_load_and_its_removal() -> None:
    """A spring behind a slider: the slip at which it rests stays after the load."""
    matrix = np.array([[1.0, 0.0], [0.0, 1.0]])
    problem = Problem.of(matrix, np.arange(1), np.array([0.5]), 1)
    pressed = problem.rows * np.array([-1.0, 0.0])
    state = _followed(problem, unloaded(problem, np.zeros(2)), np.zeros(2), pressed, 1.0)
    moved = problem.rows * np.array([0.0, 2.0])
    slid = _followed(problem, state, pressed - moved, moved, 2.0)
    assert slid.x[1] == pytest.approx(-0.5)
    assert slid.work.sum() == pytest.approx(0.5 * 1.5)
    back = _followed(problem, slid, pressed + 3.0 * moved, -moved, 3.0)
    assert back.x[1] == pytest.approx(0.5)
    assert back.work.sum() == pytest.approx(0.5 * (1.5 + 1.0))


def test_a_jammed_node_that_is_pulled_off_snaps_open_at_the_fold() -> None:
    """Sticking, p = 3 - 5 h and t = 2 h - 1.5 for a free gap h, up to the limit t = -0.8 p at h = 0.45.
    Slipping, p = h / 0.6 with a slip of 1.5 - 2 p, which grows back to h = 0 only: the path folds, and goes
    on open."""
    problem = Problem.of(np.array([[1.0, 2.0], [2.0, 5.0]]), np.arange(1), np.array([0.8]), 1)
    drawn, pulled = problem.rows * np.array([-1.0, 1.5]), problem.rows * np.array([1.0, 0.0])
    state = _loaded(problem, unloaded(problem, np.zeros(2)), drawn, -1.0)
    assert state.status.stuck.all()
    path = list(follow(problem, state, drawn + pulled, pulled, [0.44, 1.0]))
    stuck, last = next(one for one in path if one.lam == 0.44), path[-1]
    np.testing.assert_allclose(stuck.x * problem.columns, [3.0 - 5.0 * 0.44, 2.0 * 0.44 - 1.5])
    (snap,) = [one for one in path if one.jumped]
    assert snap.lam == pytest.approx(0.45, abs=1e-6)
    assert not last.status.closed.any()
    np.testing.assert_allclose(last.w / problem.rows, [1.0, 1.5])


def test_free_bodies_without_load_stay_where_they_are() -> None:
    problem, weight, _ = _block(0.3)
    found = solve(
        problem,
        0.0 * weight,
        problem.touching(weight[:2] > 0.0),
        near=np.array([0.0, 0.0, 0.0, 0.0, 4.0, 5.0, 0.5]),
    )
    np.testing.assert_allclose(found.x[4:], [4.0, 5.0, 0.5])
    assert not found.x[:4].any()


@pytest.mark.parametrize(
    ("below", "above", "drag", "free"),
    [(0.3, 0.3, 1.0, True), (0.4, 0.3, 1.0, False), (0.3, 0.4, 1.0, False), (0.3, 0.3, 0.2, False)],
)
def test_a_plate_dragged_between_equal_contacts_may_follow_either(
    below: float, above: float, drag: float, free: bool
) -> None:
    """A plate with motions along and across between the ground and a block that is pressed by 1 and moved."""
    gap, slip = np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([[1.0, 0.0], [-1.0, 0.0]])
    moved = np.vstack([gap, slip])
    matrix = np.block([[np.eye(4), moved], [-moved.T, np.zeros((2, 2))]])
    problem = Problem.of(matrix, np.arange(2), np.array([below, above]), 2)
    pressed = problem.rows * np.array([0.0, -2.0, 0.0, 0.0, 0.0, 0.0])
    dragged = pressed + problem.rows * np.array([0.0, 0.0, 0.0, drag, 0.0, 0.0])
    state = _loaded(problem, unloaded(problem, np.zeros(6)), pressed, 0.0)
    state = _followed(problem, state, pressed, dragged - pressed, 1.0)
    none = np.zeros((0, 2))
    assert (undetermined(problem, state.status, state.x, none) is not None) == free
    # A load on the plate would drive it.
    assert undetermined(problem, state.status, state.x, np.array([[1.0, 0.0]])) is None


@pytest.mark.parametrize("seed", [1632, 2015, 2023])
def test_statuses_that_recur_are_found_by_pivots(seed: int) -> None:
    """Eight nodes with much friction, whose Newton steps recur; and the same with a motion in balance,
    by which they are as compliant."""
    count, rng = 8, np.random.default_rng(seed)
    root = rng.normal(size=(2 * count, 2 * count))
    compliance = root @ root.T / (2 * count) + 0.05 * np.eye(2 * count)
    free = np.concatenate([rng.normal(size=count) - 0.5, rng.normal(size=count)])
    mu, nodes, stuck = np.full(count, 0.8), np.arange(count), np.ones(count, dtype=bool)
    start = ContactStatus(stuck, stuck, np.zeros(count))
    example = Example(compliance, free, nodes, mu, count)
    problem = Problem.of(compliance, nodes, mu, count)
    found = solve(problem, problem.rows * free, start)
    assert example.accepts(found.x, 1e-9)
    moves = rng.normal(size=(2 * count, 1))
    driven = Problem.of(
        np.block([[compliance - moves @ moves.T, moves], [-moves.T, np.ones((1, 1))]]), nodes, mu, count
    )
    moved = solve(driven, driven.rows * np.append(free, 0.0), start)
    np.testing.assert_allclose(moved.x[:-1], found.x, atol=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-17, 1e-15])
def test_a_rotation_that_only_round_off_resists_is_not_resisted(tilt: float) -> None:
    """A driven disk between two nodes that slip: round-off in its outline tilts their normals."""
    elastic, none = np.array([[2.0, 0.5], [0.5, 2.0]]), np.zeros((2, 2))
    turn = np.array([[tilt], [-0.7 * tilt], [1.0], [1.0]])
    compliance = np.block([[elastic, none], [none, elastic]])
    matrix = np.block([[compliance, turn], [-turn.T, np.zeros((1, 1))]])
    problem = Problem.of(matrix, np.arange(2), np.full(2, 0.3), 2)
    closed = np.ones(2, dtype=bool)
    sliding = ContactStatus(closed, ~closed, np.array([1.0, -1.0]))
    with pytest.raises(SingularError):
        Basis(problem, sliding).solve(np.array([-1.0, -1.2, 0.0, 0.0, 0.3]), np.zeros(2))
