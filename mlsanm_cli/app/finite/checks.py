"""Checks of a completed path at finite strain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.ended import (
    COMMON,
    NODE_FORCE_SHIFT,
    EnergyErrors,
    displacement_estimate,
    force_estimate,
    pressure_estimate,
    thin_part,
)
from mlsanm_cli.app.checks.limits import level
from mlsanm_cli.app.finite.accuracy import energy_errors, work_error
from mlsanm_cli.app.finite.fields import SceneForces, fields_of
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.case import Case
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import State

RECOMMENDED_REFINEMENT = 8.0
"""Factor by which the message of a large estimate of the energy proposes to refine."""


@dataclass(frozen=True)
class FiniteEnd:
    """A completed path: its ``last`` state with the estimated ``errors`` of ``summary.error_estimate``,
    and the totals of the path (``tally``)."""

    scene: FiniteScene
    last: State
    tally: Mapping[str, Any]
    errors: Mapping[str, Any]

    @property
    def case(self) -> Case:
        return self.scene.case

    @cached_property
    def imbalance(self) -> Mapping[str, float]:
        """Missing force of the body where it is largest; empty with bodies held at single nodes, whose
        reactions are not known from the stress."""
        if any(body.elastic.held_nodes for body in self.scene.bodies.values()):
            return {}
        forces = SceneForces(self.scene, self.last).bodies
        return {max(forces, key=lambda name: forces[name].rest): self.tally["balance"]}

    @cached_property
    def energies(self) -> EnergyErrors:
        """Work of the stresses less that of the forces, of the body where it is largest."""
        missing, bodies = self.tally["missing"], self.scene.bodies
        worst = max(missing, key=lambda name: abs(missing[name]), default=next(iter(bodies)))
        error = work_error(self.tally) * (-1.0 if missing.get(worst, 0.0) < 0.0 else 1.0)
        thin = {name: thin_part(body.elastic.model.cloud) for name, body in bodies.items()}
        name = "series_energy_error" if self.scene.by_series else "energy_error"
        what = "the work of stresses in"
        return EnergyErrors({worst: error}, {}, pointed(self.scene, self.last), thin, name=name, what=what)


def energy_estimate(end: FiniteEnd) -> Iterator[Check]:
    """Estimated error of the energy by residuals, with the place of its largest contribution, or that most of
    it is due to residuals kept by equations."""
    estimate = end.errors["energy"]
    if estimate <= level("energy_estimate"):
        yield Check("energy_estimate", estimate, "")
        return
    message = f"estimated error of the energy: {100.0 * estimate:.2g} % (forces may be as far off), "
    kept = end.tally["kept"] / end.tally["energy"]
    if kept > 0.5 * estimate:
        message += f"{100.0 * kept:.2g} % of it due to residuals that renewed equations keep next to crushed "
        hint = "make the loads smaller, or round these corners"
        yield Check("energy_estimate", estimate, f"{message}corners", hint)
        return
    nodal, size = energy_errors(end.scene, end.last)[0], end.scene.size
    body = max(nodal, key=lambda name: float(nodal[name].max()))
    cloud, node = end.scene.bodies[body].elastic.model.cloud, int(np.argmax(nodal[body]))
    x, y = np.round(cloud.points[node] / size, 9) * size + 0.0
    yield Check(
        "energy_estimate",
        estimate,
        f"{message}most of it at ({x:.6g}, {y:.6g}) of body {body}",
        f"refine there and at similar places, with slow growth, as in [[body.refine]] at = "
        f"[{x:.6g}, {y:.6g}], spacing = {cloud.spacing[node] / RECOMMENDED_REFINEMENT:.2g}, radius = 0, "
        f"growth = 0.1",
    )


def estimates(end: FiniteEnd) -> Iterator[Check]:
    """Estimated errors of displacements, forces and pressures."""
    forces, pressures = end.errors.get("contacts", {}), end.errors.get("pressure", {})
    yield from displacement_estimate(end.case, end.errors)
    for contact in end.scene.contacts.pairs:
        name, bodies = contact.name, [side.body for side in contact.sides]
        if name in forces:
            yield force_estimate("finite_force_error", end.case, name, bodies, forces[name])
        yield from pressure_estimate("rough_pressure_error", end.case, name, bodies, pressures.get(name))


def increments(end: FiniteEnd) -> Iterator[Check]:
    """Error of the increments of friction."""
    if "increments" in end.errors:
        error = end.errors["increments"]
        message = f"forces are estimated to be off by {100 * error:.2g} % by the increments of friction"
        yield Check(
            "increment_error", error, message, "use a smaller solver.increment_error or max_increment"
        )


def bifurcations(end: FiniteEnd) -> Iterator[Check]:
    """Bifurcations of the path: the first one, and where it leads."""
    found = [one for one in end.tally["bifurcations"] if not (one["followed"] and one["decided"])]
    if not found:
        yield Check("bifurcation", 0.0, "")
        return
    first = found[0]
    (x, y), (u, v) = first["point"], first["direction"]
    how = f"in which body {first['body']} moves most at ({x:.6g}, {y:.6g}), along ({u:.3g}, {v:.3g})"
    where = f"stability is lost at position {first['position']:.6g}"
    if first["followed"]:
        message = (
            f"{where}, where the path bifurcates: it goes on along the branch {how}; its mirror image may "
        )
        message += "be as likely"
        hint = "a small asymmetry of shapes or loads decides on the branch"
    else:
        message = f"{where} in a motion {how}: no stable state is near, and the bodies jump"
        hint = "prescribe displacements instead of forces, or end the path there"
    yield Check("bifurcation", float(len(found)), message, hint)


def located(end: FiniteEnd) -> Iterator[Check]:
    """Whether knots were placed for the whole path."""
    beyond = end.last.position - end.scene.located
    if beyond > 0.0:
        yield Check(
            "located_contacts",
            beyond,
            f"contacts were located up to position {end.scene.located:.6g} only, where a path with coarse "
            "pressures stopped: patches of contact that come later are as coarse as the nodes",
            "use finer nodes where bodies touch, which are the first knots of pressures",
        )


def folded(end: FiniteEnd) -> Iterator[Check]:
    """Nodes, next to singular points, where the fields shown are not invertible."""
    for name, fields in fields_of(end.scene, end.last).items():
        volume = fields["volume_ratio"]
        count, least = int((volume <= 0.0).sum()), int(np.argmin(volume))
        x, y = end.scene.bodies[name].elastic.model.cloud.points[least]
        message = f"body {name}: no stresses at {count} nodes, above all at ({x:.6g}, {y:.6g}), where the "
        message += f"deformation between nodes is not invertible (det F = {volume[least]:.3g})"
        yield Check("folded_nodes", float(count), message, "use finer nodes there", f"body {name}")


def pointed(scene: FiniteScene, state: State) -> dict[str, float]:
    """Increase of the displacements of bodies held at single nodes when the spacing is halved, relative to
    the deformation."""
    found = {}
    forces, parts = SceneForces(scene, state), scene.parts(state.displacement)
    for name, body in scene.bodies.items():
        nodes = body.elastic.held_nodes[: len(body.elastic.held_nodes) - body.pins]
        counts = np.array([sum(axis == one for _, one in nodes) for axis in (0, 1)])
        if not counts.any():
            continue
        cloud, own = body.elastic.model.cloud, parts[name]
        force = np.where(counts, forces.bodies[name].total / np.maximum(counts, 1), 0.0)
        soft = body.elastic.model.material.contact_compliance(np.eye(2))
        angle = body.turn(own)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        bent = cloud.points + own.reshape(-1, 2) - cloud.points @ turn.T
        bent = np.abs(bent - cloud.areas @ bent / cloud.areas.sum()).max()
        found[name] = float((NODE_FORCE_SHIFT * soft * np.abs(force)).max() / bent) if bent else 0.0
    return found


END: Sequence[Callable[[FiniteEnd], Iterator[Check]]] = (
    *(energy_estimate, estimates, located, increments, bifurcations, folded),
    *COMMON,
)
"""Checks of a completed path at finite strain."""
