"""One elastic body: its discrete system, right-hand sides and functionals.

Order of the rows: equilibrium in x and y at every node, boundary nodes included; then, surface by surface,
the x and y conditions at its nodes, a displacement where the component is held and a traction elsewhere; then
single held nodes. A corner node has the rows of both its surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, GAUSS, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.pieces import Pieces, StressAround, rule_of
from mlsanm_cli.mechanics.rigid import RigidBodyModes
from mlsanm_cli.mechanics.supports import FREE, Held, Springs, restrained, soft
from mlsanm_cli.memo import digest
from mlsanm_cli.operators.system import LinearSystem
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Timed: TypeAlias = Callable[[], AbstractContextManager[None]]
"""Returns a context manager that measures the time of an operation."""


class BodyEquations:
    """A body's equations, factorised by ``factorise`` within ``timed()`` on first use. ``content`` is a
    digest of all their input."""

    def __init__(self, content: str, factorise: Callable[[], LinearSystem]) -> None:
        self.content, self._factorise = content, factorise
        self.timed: Timed = nullcontext

    @cached_property
    def system(self) -> LinearSystem:
        """The factorised system. Raises NumericalError if it is singular."""
        with self.timed():
            return self._factorise()

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; "" if there is none."""
        return self.system.note if "system" in vars(self) else ""


def first_rows(cloud: Cloud) -> tuple[dict[str, int], int]:
    """First row of every surface's conditions, x of its b nodes, then y; and of those of single nodes."""
    first_row, total = {}, 2 * len(cloud.points)
    for name, surface in cloud.surfaces.items():
        first_row[name] = total
        total += 2 * len(surface.index)
    return first_row, total


@dataclass(frozen=True)
class ElasticBody:
    """A body with its boundary conditions and its system, factorised on first use. ``held[surface]`` tells
    for x and y whether a displacement is prescribed, ``springs[surface]`` are the spring stiffnesses,
    ``held_nodes`` the (node, component) pairs held by supports, and ``free`` the rigid motions that nothing
    holds: ``system`` then solves for balanced loads, with the mean free motions of the solution as right-hand
    sides of the rows from ``first_pin`` on. The last of the ``rows`` are three for each of the k ``pieces``;
    their right-hand sides are the loads in excess of those represented by the nodes' right-hand sides."""

    model: BodyModel
    held: Mapping[str, tuple[bool, bool]]
    springs: Springs
    free: RigidBodyModes
    rows: int
    pieces: Pieces
    loads_on_pieces: Callable[[], sparse.csr_array]
    equations: BodyEquations
    held_nodes: tuple[tuple[int, int], ...] = ()

    @property
    def system(self) -> LinearSystem:
        """The factorised system. Raises NumericalError if it is singular."""
        return self.equations.system

    @property
    def content(self) -> str:
        """Digest of the body with its conditions."""
        chosen = [self.held, self.springs, self.free, self.rows]
        return digest(self.model.content, self.equations.content, chosen)

    @property
    def first_pin(self) -> int:
        """First row of the free motions, after those of the held nodes."""
        return self.rows - 3 * self.pieces.count - len(self.free.components)

    def pin_rows(self, node: int) -> list[tuple[int, int]]:
        """Components in which a single node is held, with the rows of these conditions."""
        first = self._first_rows[1]
        return [(axis, first + row) for row, (own, axis) in enumerate(self.held_nodes) if own == node]

    @cached_property
    def _first_rows(self) -> tuple[dict[str, int], int]:
        return first_rows(self.model.cloud)

    def condition_rows(self, surface: str, component: int) -> IntArray:
        """Row numbers (b,) of a surface's conditions in x (0) or y (1)."""
        count = len(self.model.cloud.surfaces[surface].index)
        first = self._first_rows[0][surface] + component * count
        return np.arange(first, first + count, dtype=np.int64)

    def source(
        self, surface: str, values: FloatArray, held: bool, between: FloatArray | None = None
    ) -> FloatArray:
        """Right-hand side (r,) for ``values`` (b, 2) on a surface: displacements of the held components if
        ``held``, else tractions of the others, linear between nodes unless given ``between`` (g, 2) them, at
        the FINE quadrature points."""
        source = np.zeros(self.rows)
        for component in (0, 1):
            if self.held.get(surface, FREE)[component] == held:
                source[self.condition_rows(surface, component)] = values[:, component]
        if between is not None and not held:
            taken, where = ~np.array(self.restrained.get(surface, FREE)), self.model.cloud.surfaces[surface]
            halves = Halves.of(where, FINE)
            points = where.curve.points(halves.arc)
            force = (halves.length * self.model.cloud.around(points))[:, None] * (between * taken)
            whole = self.pieces.gathered(where.index[halves.own], points, force)
            source[self.rows - len(whole) :] = whole - self.loads @ source
        return source

    def stress_source(self, stress: FloatArray, divergence: FloatArray, around: StressAround) -> FloatArray:
        """Right-hand side (r,) for the tractions of a nodal ``stress`` (n, 3 | 4), its ``divergence`` (n, 2),
        and fluxes of the stress ``around``."""
        source = np.zeros(self.rows)
        source[: divergence.size] = divergence.T.ravel()
        for name, surface in self.model.cloud.surfaces.items():
            source += self.source(name, traction_of(stress[surface.index], surface.normal), held=False)
        fluxes = self.pieces.fluxes(around, self.restrained, GAUSS[2])
        source[self.rows - len(fluxes) :] = fluxes - self.loads @ source
        return source

    def force_source(self, force: FloatArray) -> FloatArray:
        """Right-hand side (r,) of a ``force`` (n, 2) per volume, linear between nodes: div sigma = -force."""
        source = np.zeros(self.rows)
        source[: force.size] = -force.T.ravel()
        source[self.rows - 3 * self.pieces.count :] = self.pieces.of_force(force)
        return source

    @property
    def loads(self) -> sparse.csr_array:
        """Force and moment (3k, r) on the pieces per right-hand side."""
        return self.loads_on_pieces()

    def resultants(self, center: tuple[float, float] = (0.0, 0.0)) -> sparse.csr_array:
        """Force x, force y and moment about ``center`` (3, r) per right-hand side."""
        return sparse.csr_array(self.pieces.totals(center) @ self.loads)

    def reaction(self, surface: str, center: tuple[float, float], stress: StressAround) -> Any:
        """Rows or values (3, ...) of force and moment about ``center`` of a held surface by a ``stress``."""
        held = {surface: self.restrained[surface]}
        return self.pieces.reaction(stress, held, rule_of(self.model), center)

    def reaction_rows(self, surface: str, center: tuple[float, float] = (0.0, 0.0)) -> sparse.csr_array:
        """The same (3, 2N) by displacements."""
        return sparse.csr_array(self.reaction(surface, center, self.model.stress_around))

    @cached_property
    def restrained(self) -> Held:
        """Components of surfaces that are held, or have stiff springs."""
        return restrained(self.held, self.springs, self.model.cloud, self.model.material)

    @cached_property
    def soft_springs(self) -> Springs:
        """The soft springs."""
        return soft(self.springs, self.model.cloud, self.model.material)


SUBSPACE_STEPS = 8


def bulk_stability(body: ElasticBody) -> float:
    """Smallest singular value of the equations, normalised by the response to smooth loads.

    With S the scaled equations and displacements measured by |u|^2 = sum h^2 u_i^2 over the cloud's points::

        sigma = min |S u| / |u|        stability = sigma max_b |u_b| / |S b|        0 < stability

    b are linearly varying body forces and u_b their displacements without free rigid parts. In a sound
    discretisation hardly any residual causes more displacement than these. The rows of pieces count in S u
    but not in S b. sigma is computed by a few steps of subspace iteration with the available factor (Golub
    and Van Loan, Matrix Computations, section 8.2) from a fixed start.
    """
    model, system = body.model, body.system
    measure = np.repeat(model.cloud.spacing, 2)[:, None]
    rigid = np.linalg.qr(measure * body.free.patterns(model.cloud.points))[0]

    def deforming(displacements: FloatArray) -> FloatArray:
        """Displacements, one column each, in the measure and without their free rigid part."""
        measured = measure * displacements
        return measured - rigid @ (rigid.T @ measured)

    # Body forces in x and in y: uniform, linear in x, and linear in y.
    points = model.cloud.points
    middle, extent = points.mean(axis=0), np.ptp(points, axis=0).max()
    shapes = np.column_stack([np.ones(len(points)), (points - middle) / extent])
    forces = [body.force_source(np.outer(shape, axis)) for axis in np.eye(2) for shape in shapes.T]
    loads = sparse.csc_array(np.stack(forces, axis=1))
    response = deforming(system.solve(loads))
    scaled = system.scaled(loads, strong=False)
    # Discard loads that vanish or coincide on a few nodes.
    _, sizes, turned = np.linalg.svd(scaled, full_matrices=False)
    kept = sizes > COARSE_ROUND_OFF * sizes[0]
    smooth = np.linalg.norm(response @ turned[kept].T / sizes[kept], 2) ** 2
    rough = np.random.default_rng(0).normal(size=(len(measure), 2))
    space: FloatArray = np.concatenate([response, rough], axis=1)
    for _ in range(SUBSPACE_STEPS):
        space = np.linalg.qr(space)[0]
        image = deforming(system.inverse_normal(measure * space))
        largest = np.linalg.eigvalsh(0.5 * (space.T @ image + image.T @ space))[-1]
        space = image
    return float(np.sqrt(smooth / largest))
