"""The path of a body pressed by rigid obstacles: increments of Newton's method with exact contact."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.finite.path import RENEW, FiniteState, FiniteStep, most_stretched
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.finite.verdict import judge
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.exact import Pressed, Pressing
from mlsanm_cli.errors import NumericalError, UnstableError
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.solve.coercivity import CONTACT_LIMIT
from mlsanm_cli.solve.load_factors import factors_at

FIRST = 0.25
"""First increment, as a part of a stage."""
MOST = 14
"""Iterations after which an increment is halved; one that took a third of them makes the next one longer."""
SHORTEST = 1e-5


def contact_path(scene: FiniteScene) -> Iterator[FiniteStep]:
    """All steps, the start first. Raises NumericalError where the path breaks off."""
    walk = _Walk(scene)
    wanted = sorted(set(scene.case.output.at)) or [float(len(scene.stages) - 1)]
    first = walk.state(0.0, walk.start())
    yield FiniteStep(first, (first,) if 0.0 in wanted else (), factorizations=walk.spent)
    steps, size, position = 0, FIRST, 0.0
    ends = sorted({*wanted, *np.arange(1.0, len(scene.stages)).tolist()})
    for end in (one for one in ends if one > 0.0):
        while position < end:
            reached, size = walk.forward(position, end, size)
            steps += 1
            if steps > scene.case.solver.max_steps:
                raise NumericalError(
                    f"the path stopped at position {reached:.6g}: max steps", "raise solver.max_steps"
                )
            state = walk.state(reached, walk.now)
            judge(scene, reached, walk.now.displacement)
            _resist(reached, walk.now.stability)
            done = walk.told(state, reached - position, (state,) if reached in wanted else ())
            position = reached
            yield done


def _resist(position: float, stability: float) -> None:
    """Raise UnstableError where pressures could change from node to node at will."""
    if not stability >= CONTACT_LIMIT:
        raise UnstableError(
            f"the contact does not resist pressures that change from node to node at position {position:.6g} "
            f"(stability {stability:.2g}, below {CONTACT_LIMIT:g})",
            "use mls.degree = 2, another body.seed, or an even cloud (lower growth)",
            stability,
        )


class _Walk:
    """Where the path is, and its equations."""

    def __init__(self, scene: FiniteScene) -> None:
        self._scene = scene
        count = sum(one.count for one in scene.contacts)
        still = np.zeros(scene.body.unknowns)
        self._projector = scene.projector(still, np.zeros(scene.body.loads.count))
        moved = [
            float(np.abs(one.motion @ factors).max()) for one in scene.contacts for factors in scene.stages
        ]
        size = float(np.ptp(scene.body.elastic.model.nodes, axis=0).max())
        self._length = min(max([*moved, 1e-3 * size]), size)
        modulus = scene.body.elastic.model.material.modulus
        self._stiffness = modulus / size
        self.now = Pressed(still, np.zeros(count), np.zeros(count), np.zeros((count, 2)), 0.0, 0, 0)
        self.spent, self._iterations, self._solves = 1, 0, 0

    def start(self) -> Pressed:
        """The state before loading; NumericalError where it does not settle."""
        return self._solved(0.0) or self._failed(0.0)

    def forward(self, position: float, end: float, size: float) -> tuple[float, float]:
        """Go on toward ``end`` by an increment of about ``size``; where that led, and the next one's size."""
        stage = int(position)
        while True:
            reached = end if position + 1.001 * size >= end else position + size
            reached = min(reached, float(stage + 1))
            found = self._solved(reached)
            if found is not None:
                self.now = found
                return reached, 1.6 * size if 3 * found.iterations <= MOST else size
            size *= 0.5
            if size < SHORTEST:
                self._failed(position)

    def _solved(self, position: float) -> Pressed | None:
        factors = factors_at(self._scene.stages, position)
        pressing = Pressing(self._projector, self._scene.contacts, self._length, self._stiffness)
        tolerance = self._scene.case.solver.tolerance
        with np.errstate(all="ignore"):
            try:
                found = pressing.solved(self.now.displacement, self.now.pressure, factors, tolerance, MOST)
            except (np.linalg.LinAlgError, NumericalError):
                found = None
        tried = MOST if found is None else found.iterations
        self.spent += tried
        self._iterations += tried
        self._solves += 0 if found is None else found.solves
        return found

    def _failed(self, position: float) -> Pressed:
        raise NumericalError(
            f"the path stopped at position {position:.6g}: no increment of contact settles",
            "use finer nodes under the obstacle, smaller loads, or raise solver.tolerance",
        )

    def told(self, state: FiniteState, length: float, saved: tuple[FiniteState, ...]) -> FiniteStep:
        """The step that ends in a state, with what it cost; the equations are renewed if they are far."""
        station = self._projector.station
        renewed = most_stretched(self._scene.body, state.displacement, station) > RENEW
        if renewed:
            self._projector = self._renewed(state)
            self.spent += 1
        step = FiniteStep(state, saved, length, 0, self._iterations, self.spent, self._solves, (), renewed)
        self.spent = self._iterations = self._solves = 0
        return step

    def _renewed(self, state: FiniteState) -> Projector:
        whole = np.concatenate([state.factors, (self.now.pressure[:, None] * self.now.normal).ravel()])
        return self._scene.projector(state.displacement, whole)

    def state(self, position: float, found: Pressed) -> FiniteState:
        """As the path tells it."""
        factors: FloatArray = factors_at(self._scene.stages, position)
        self.now = found
        return FiniteState(
            position,
            factors,
            found.displacement,
            found.residual,
            found.pressure,
            found.gap,
            found.normal,
            found.stability,
        )
