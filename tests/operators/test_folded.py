"""Half of a symmetric body's equations against all of them, on the same cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import Outline, Segment, annulus, rectangle
from mlsanm_cli.cloud.mirror import Line, Mirror
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import BodyModel, ElasticBody
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic, orthotropic
from mlsanm_cli.mechanics.springs import Springs
from mlsanm_cli.operators.folded import Folded
from mlsanm_cli.operators.least_squares import LeastSquares
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.system import LinearSystem
from tests.mechanics.bodies import STEEL

BLOCK = rectangle((-1.0, 1.0), (-0.5, 0.5))
UPRIGHT, LEVEL = Line(0, 0.0), Line(1, 0.0)
EVEN = Spacing(0.12)
SAME = 1e-10
"""Largest difference of solutions."""
WORTH = 1e-8
"""What the last update of checked ones changed at most: strong rows cost the factor some digits, and one
update more is done where this is not below 1e-7."""
ROOF = Outline(
    ("floor", "right", "falling", "rising", "left"),
    tuple(
        Segment(one, other)
        for one, other in (
            ((-1.0, 0.0), (1.0, 0.0)),
            ((1.0, 0.0), (1.0, 0.5)),
            ((1.0, 0.5), (0.0, 1.0)),
            ((0.0, 1.0), (-1.0, 0.5)),
            ((-1.0, 0.5), (-1.0, 0.0)),
        )
    ),
)
WOOD = orthotropic((120.0, 9.0, 5.0), (0.4, 0.3, 0.4), 7.0, 0.5 * np.pi, "stress")


@dataclass(frozen=True)
class Setting:
    """A symmetric body: where its mirror is, what holds it."""

    outline: Outline = BLOCK
    line: Line = UPRIGHT
    held: dict[str, tuple[bool, bool]] = field(default_factory=lambda: {"bottom": (True, True)})
    springs: Springs = field(default_factory=dict)
    on_the_line: tuple[int, ...] = ()
    degree: int = 2
    material: PlaneMaterial = STEEL
    spacing: Spacing = EVEN

    @cached_property
    def model(self) -> BodyModel:
        """Nodes and stencils of both bodies."""
        cloud = build_cloud(self.outline, self.spacing, 0, line=self.line)
        return BodyModel.build("body", cloud, self.material, MlsSettings(self.degree))

    @property
    def cloud(self) -> Cloud:
        """The nodes."""
        return self.model.cloud

    @property
    def mirror(self) -> Mirror:
        """The nodes' symmetry."""
        assert self.cloud.mirror is not None
        return self.cloud.mirror

    def body(self, halved: bool) -> ElasticBody:
        """The body with all its equations, or with half of them."""
        lowest = int(np.flatnonzero(self.mirror.side == 0)[0])
        nodes = [(lowest, component) for component in self.on_the_line]
        return assemble(self.model, self.held, nodes, CholeskySolver(), self.springs, halved=halved)

    @cached_property
    def whole(self) -> ElasticBody:
        """All equations."""
        return self.body(halved=False)

    @cached_property
    def half(self) -> ElasticBody:
        """Half of them."""
        return self.body(halved=True)

    def load(self, sign: float, seed: int = 0, halved: bool = False) -> sparse.csc_array:
        """Random loads (r, 1) whose image is ``sign`` times themselves."""
        rng, body = np.random.default_rng(seed), self.half if halved else self.whole
        cloud, mirror = self.cloud, self.mirror
        force = rng.normal(size=cloud.points.shape)
        force += sign * force[mirror.image] * mirror.line.signs
        # Rough at the nodes; on pieces linear, which does not depend on the triangles across the mirror.
        even = cloud.points @ rng.normal(size=(2, 2)) + rng.normal(size=2)
        even += sign * even[mirror.image] * mirror.line.signs
        source = body.force_source(even)
        source[: force.size] -= force.T.ravel()
        for held in (False, True):
            size = 0.01 if held else 10.0
            free = {name: size * rng.normal(size=(len(s.index), 2)) for name, s in cloud.surfaces.items()}
            for name, values in free.items():
                other, places = mirror.surfaces[name]
                even = values + sign * free[other][places] * mirror.line.signs
                source += body.source(name, even, held=held)
        return sparse.csc_array(source[:, None])


SETTINGS = {
    "clamped": Setting(),
    "zone": Setting(spacing=Spacing(0.2, (Zone.around((0.0, 0.5), 0.03, 0.1, 0.15),))),
    "rolling": Setting(held={"bottom": (False, True)}, on_the_line=(0,)),
    "hanging at a node": Setting(held={"left": (True, False), "right": (True, False)}, on_the_line=(1,)),
    "springs": Setting(held={}, springs={"bottom": (5.0, 30.0)}),
    "springs on two sides": Setting(springs={"left": (7.0, 0.0), "right": (7.0, 0.0)}),
    "level": Setting(line=LEVEL, held={"left": (True, True)}),
    "two surfaces meet": Setting(outline=ROOF, held={"floor": (True, True)}),
    "held at the ridge": Setting(outline=ROOF, held={"rising": (True, True), "falling": (True, True)}),
    "ring": Setting(outline=annulus((0.0, 0.0), (0.5, 1.0)), held={"inner": (True, True)}),
    "degree 1": Setting(degree=1),
    "degree 3": Setting(degree=3),
    "degree 4": Setting(degree=4),
    "degree 6": Setting(degree=6),
    "nearly incompressible": Setting(material=isotropic(210.0, 0.4999, "strain")),
    "wood": Setting(material=WOOD),
}


def apart(found: FloatArray, expected: FloatArray) -> float:
    """Largest difference, relative to the largest expected."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def systems(setting: Setting) -> tuple[Folded, LeastSquares]:
    """The half's system and the whole body's."""
    half, whole = setting.half.system, setting.whole.system
    assert isinstance(half, Folded)
    assert isinstance(whole, LeastSquares)
    return half, whole


@pytest.mark.parametrize("degree", [1, 2, 4])
@pytest.mark.parametrize("line", [UPRIGHT, LEVEL])
def test_stencils_are_their_own_images_and_reproduce_polynomials(line: Line, degree: int) -> None:
    setting = Setting(line=line, degree=degree)
    points, mirror, stencils = setting.cloud.points, setting.mirror, setting.model.stencils
    field = np.random.default_rng(0).normal(size=(len(points), 2))
    found = stencils.derivatives(field)
    image = stencils.derivatives(field[mirror.image]) * mirror.derivative_signs(6)[:, None]
    assert apart(image[mirror.image], found) <= 1e-11
    x, y = points.T
    for p, q in [(p, total - p) for total in range(degree + 1) for p in range(total + 1)]:
        found = stencils.derivatives((x**p * y**q)[:, None])[:, :3, 0]
        dx, dy = p * x ** max(p - 1, 0) * y**q, q * x**p * y ** max(q - 1, 0)
        assert np.abs(found - np.stack([x**p * y**q, dx, dy], axis=1)).max() <= 1e-9


@pytest.mark.parametrize(
    "name", ["clamped", "zone", "two surfaces meet", "ring", "hanging at a node", "level"]
)
def test_strong_rows_are_their_own_images(name: str) -> None:
    setting = SETTINGS[name]
    (half, whole), mirror = systems(setting), setting.mirror
    rows = whole.strong.rows
    u = np.random.default_rng(4).normal(size=(len(setting.cloud.points), 2))
    image = u[mirror.image] * mirror.line.signs
    pieces, fold = setting.whole.pieces, half.fold
    alone = fold.strong == fold.strong_image
    found, expected = rows @ image.ravel(), rows @ u.ravel()
    assert rows.shape[0] == 3 * pieces.count
    assert (fold.strong_sign[alone] == 1.0).all()
    difference = found[fold.strong_image] - fold.strong_sign * expected[fold.strong]
    assert np.abs(difference).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("name", SETTINGS)
def test_symmetric_loads_have_the_solutions_of_the_whole_body(name: str) -> None:
    setting = SETTINGS[name]
    half, whole = systems(setting)
    assert half.fold.unknowns < 0.6 * 2 * len(setting.cloud.points)
    even = setting.load(1.0)
    expected = whole.solve(even)
    assert apart(half.solve(even), expected) <= SAME
    # They are their own images.
    u = expected.reshape(-1, 2)
    assert apart(u[setting.mirror.image] * setting.line.signs, u) <= SAME


@pytest.mark.parametrize("name", ["clamped", "level", "springs", "two surfaces meet", "degree 4"])
def test_the_symmetric_part_of_any_load_is_answered(name: str) -> None:
    setting = SETTINGS[name]
    system = setting.half.system
    even, odd = setting.load(1.0), setting.load(-1.0, seed=1)
    expected = system.solve(even)
    assert np.abs(system.solve(odd)).max() <= 1e-9 * np.abs(expected).max()
    assert apart(system.solve(sparse.csc_array(even + odd)), expected) <= 1e-9
    observed = sparse.random_array((5, len(expected)), density=0.05, rng=np.random.default_rng(2)).tocsr()
    assert (
        apart(system.functionals(observed, sparse.csc_array(even + odd)), np.asarray(observed @ expected))
        <= 1e-7
    )


@pytest.mark.parametrize("name", ["clamped", "level", "springs", "two surfaces meet", "rolling"])
def test_what_is_not_symmetric_is_told(name: str) -> None:
    setting = SETTINGS[name]
    system = setting.half.system
    assert isinstance(system, Folded)
    even, odd = setting.load(1.0), setting.load(-1.0, seed=1)
    solution, worth = system.solve_with_error(even)
    assert worth.max() <= WORTH
    assert system.residual(even, solution).max() <= 1e-9
    for part in (1e-4, 0.1, 1.0):
        mixed = sparse.csc_array(even + part * odd)
        nodes = system.fold.rows
        share = part * sparse.linalg.norm(odd[:nodes]) / sparse.linalg.norm(mixed[:nodes])
        for found in (system.solve_with_error(mixed)[1], system.residual(mixed, solution)):
            assert found == pytest.approx([share], rel=1e-6)
    assert system.residual(odd, solution)[0] >= 1.0 - 1e-9


@pytest.mark.parametrize("name", ["clamped", "level", "springs", "two surfaces meet", "rolling"])
def test_one_entry_is_half_symmetric_beside_the_line_and_all_or_nothing_on_it(name: str) -> None:
    setting = SETTINGS[name]
    system, mirror, rows = setting.half.system, setting.mirror, setting.half.rows
    count, across = len(setting.cloud.points), setting.line.axis
    (on, beside), size = (int(np.flatnonzero(mirror.side == side)[-1]) for side in (0, 1)), 0.5**0.5
    for node, component, expected in (
        (beside, 0, size),
        (beside, 1, size),
        (on, across, 1.0),
        (on, 1 - across, 0.0),
    ):
        entry = sparse.csc_array(([1.0], ([component * count + node], [0])), shape=(rows, 1))
        assert system.solve_with_error(entry)[1] == pytest.approx([expected], abs=1e-9)


@pytest.mark.parametrize(
    "name", ["clamped", "level", "two surfaces meet", "degree 4", "nearly incompressible"]
)
def test_all_else_is_as_the_whole_system_has_it(name: str) -> None:
    setting = SETTINGS[name]
    half, whole = systems(setting)
    even, more = (sparse.csc_array(setting.load(1.0, seed)) for seed in (0, 1))
    expected = whole.solve(even)
    rng, mirror = np.random.default_rng(3), setting.mirror
    observed = sparse.random_array((7, len(expected)), density=0.03, rng=rng).tocsr()
    both, mixture = (
        sparse.csc_array(sparse.hstack([even, more])),
        np.array([[1.0, 0.5, 0.0], [0.0, 2.0, 1.0]]),
    )
    for mixed in (None, mixture):
        one, other = (system.functionals(observed, both, mixed) for system in (half, whole))
        assert apart(one, other) <= 1e-9
    assert apart(half.solve_unrefined(even), expected) <= 2e-5
    rough = expected * (1.0 + 1e-3)
    assert apart(half.step(even, rough, more)[:, 0], whole.step(even, rough, more)[:, 0]) <= 1e-4
    assert apart(half.step(even, rough, more)[:, 1], whole.solve(more)[:, 0]) <= 2e-5
    assert apart(half.solve_with_error(even, rough)[0], expected) <= SAME
    assert half.residual(even, rough) == pytest.approx(whole.residual(even, rough), rel=1e-4)
    vector = rng.normal(size=(len(expected) // 2, 2))
    vector += vector[mirror.image] * mirror.line.signs
    one, other = (system.inverse_normal(vector.reshape(-1, 1)) for system in (half, whole))
    assert apart(one, other) <= 1e-4
    sizes = [np.linalg.norm(system.scaled(even)) for system in (half, whole)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-12)
    assert half.note == whole.note


def test_no_equations_of_all_bodies_together() -> None:
    system: LinearSystem = SETTINGS["clamped"].half.system
    source = SETTINGS["clamped"].load(1.0)
    with pytest.raises(TypeError, match="whole"):
        system.equations(source)
    with pytest.raises(TypeError, match="whole"):
        system.residual_vector(source.toarray()[:, 0], np.zeros(system.solve(source).shape[0]))


def test_a_body_that_nothing_holds() -> None:
    # A half moves along its mirror only and has one pin where a whole body has three.
    setting = Setting(held={})
    half, whole = setting.load(1.0, halved=True), setting.load(1.0)
    assert (setting.half.free.components, setting.whole.free.components) == ((1,), (0, 1, 2))
    expected = setting.whole.system.solve(whole)
    assert apart(setting.half.system.solve(half), expected) <= SAME
    assert setting.half.system.solve_with_error(half)[1].max() <= WORTH
    odd = setting.load(-1.0, halved=True)
    assert np.abs(setting.half.system.solve(odd)).max() <= 1e-9 * np.abs(expected).max()
    assert setting.half.system.solve_with_error(odd)[1].max() >= 0.5


def test_bodies_of_both_kinds_are_told_apart() -> None:
    setting = SETTINGS["clamped"]
    assert setting.half.equations.content != setting.whole.equations.content
