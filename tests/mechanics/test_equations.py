"""Square schemes: which rows become equations, where ghosts stand."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import half_disk, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import ghost_owners, ghost_points
from mlsanm_cli.operators.settings import Scheme
from mlsanm_cli.operators.square import Square
from tests.mechanics.bodies import build, jittered_square


def square_system(body: ElasticBody) -> Square:
    assert isinstance(body.system, Square)
    return body.system


@pytest.mark.parametrize("scheme", ["collocation", "ghost"])
def test_every_unknown_has_one_equation(scheme: Scheme) -> None:
    body = build(jittered_square(9), {"bottom": (True, True), "left": (True, False)}, scheme=scheme)
    matrix = square_system(body).matrix
    assert matrix.shape == (body.model.unknowns, body.model.unknowns)
    # Each equation touches the node it stands for, so the matrix has no empty row or column.
    assert (np.diff(matrix.indptr) > 0).all()
    assert (np.diff(matrix.tocsc().indptr) > 0).all()


def test_a_free_corner_has_the_sum_of_both_tractions_and_a_clamped_one_none() -> None:
    body = build(jittered_square(9), {"bottom": (True, True)}, scheme="collocation")
    cloud, choice = body.model.cloud, square_system(body).choice

    def rows_of(corner: tuple[float, float], component: int) -> list[int]:
        node = int(np.argmin(((cloud.points - np.array(corner)) ** 2).sum(axis=1)))
        return sorted(choice[[2 * node + component]].indices.tolist())

    def condition(surface: str, position: int, component: int) -> int:
        return int(body.condition_rows(surface, component)[position])

    # Surfaces run counter-clockwise: the right one ends where the top one begins.
    for component in (0, 1):
        both = sorted([condition("right", -1, component), condition("top", 0, component)])
        assert rows_of((1.0, 1.0), component) == both
        assert rows_of((1.0, 0.0), component) == [condition("bottom", -1, component)]


def test_a_held_component_at_a_corner_leaves_the_other_its_traction() -> None:
    body = build(jittered_square(9), {"left": (True, False), "bottom": (False, True)}, scheme="collocation")
    cloud, choice = body.model.cloud, square_system(body).choice
    corner = int(np.argmin((cloud.points**2).sum(axis=1)))
    assert choice[[2 * corner]].indices.tolist() == [int(body.condition_rows("left", 0)[-1])]
    assert choice[[2 * corner + 1]].indices.tolist() == [int(body.condition_rows("bottom", 1)[0])]


def test_a_single_held_node_gives_up_its_own_equation() -> None:
    cloud = jittered_square(9)
    inner = int(np.setdiff1d(np.arange(len(cloud.points)), cloud.boundary_nodes)[3])
    for scheme in ("collocation", "ghost"):
        body = build(cloud, {"bottom": (True, True)}, held_nodes=((inner, 0),), scheme=scheme)
        row = square_system(body).matrix[[2 * inner]]
        assert (row.indices.tolist(), row.data.tolist()) == ([2 * inner], [1.0])


def test_ghosts_stand_one_spacing_outside_all_but_clamped_nodes() -> None:
    cloud = build_cloud(half_disk((0.0, 1.0), 1.0, "lower"), Spacing(0.1), 0)
    owners = ghost_owners(cloud, {"flat"})
    assert set(owners) == set(cloud.surfaces["arc"].index[1:-1])
    ghosts = ghost_points(cloud, owners)
    radius = np.hypot(ghosts[:, 0], ghosts[:, 1] - 1.0)
    assert radius == pytest.approx(1.1)
    everywhere = ghost_owners(cloud, ())
    assert np.array_equal(everywhere, cloud.boundary_nodes)


def test_ghosts_without_room_are_refused_by_place() -> None:
    slit = build_cloud(sector((0.0, 0.0), (1.0, 2.0), (0.0, np.radians(357.0))), Spacing(0.1), 0)
    with pytest.raises(NumericalError, match=r"no room for the ghost node outside \(1"):
        ghost_points(slit, ghost_owners(slit, ()))


@pytest.mark.parametrize("scheme", ["collocation", "ghost"])
def test_another_order_of_surfaces_changes_nothing(scheme: Scheme) -> None:
    cloud = build_cloud(rectangle((0.0, 1.0), (0.0, 1.0)), Spacing(0.2), 0)
    turned = type(cloud)(cloud.points, cloud.spacing, dict(reversed(cloud.surfaces.items())))
    held = {"bottom": (True, True), "right": (False, True)}
    one, other = (square_system(build(c, held, scheme=scheme)).matrix for c in (cloud, turned))
    assert np.abs((one - other).toarray()).max() <= 1e-15
