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
from mlsanm_cli.app.finite.estimate import energy_errors, work_error
from mlsanm_cli.app.finite.fields import SceneForces
from mlsanm_cli.app.finite.patches import between_nodes
from mlsanm_cli.app.finite.refinement import MAX_NODES, is_automatic
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.scene.refinement import Refinement
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import State


@dataclass(frozen=True)
class FiniteEnd:
    """A completed path: its ``last`` state with the estimated ``errors`` of ``summary.error_estimate``, the
    totals of the path (``tally``), and the ``refinement`` of the contacts."""

    scene: FiniteScene
    last: State
    tally: Mapping[str, Any]
    errors: Mapping[str, Any]
    refinement: Refinement

    @property
    def case(self) -> Case:
        return self.scene.case

    @cached_property
    def imbalance(self) -> Mapping[str, float]:
        """Missing force of the body where it is largest; empty with bodies held at single nodes, whose
        reactions are not known from the stress."""
        if any(body.elastic.held_nodes for body in self.scene.bodies.values()):
            return {}
        forces = SceneForces.of(self.scene, self.last).bodies
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


def refinement(end: FiniteEnd) -> Iterator[Check]:
    """A refinement of contacts that failed or is incomplete."""
    found = end.refinement
    if found.failed:
        message = f"the results are from the run before the last refinement, which failed: {found.failed}"
        yield Check("refinement_pass", 1.0, message)
    yield Check(
        "contact_nodes",
        float(found.fewer),
        f"contacts have fewer nodes than their accuracy requires: more than {MAX_NODES} nodes would be "
        "needed",
        "raise contact.accuracy, or refine where bodies touch with body.refine",
    )


RECOMMENDED_REFINEMENT = 8.0
"""Factor by which the message of a large estimate of the energy proposes to refine."""
MIN_FREE_NODES = 6
"""Least number of nodes in a contact that ends between nodes."""
MIN_LATERAL_SHARE = 1e-3
"""Lateral part of a force below which its direction is not reported."""
RESOLVED_NODES = 20
"""Number of nodes in a contact up to which half a spacing at its ends matters."""


def few_contact_nodes(end: FiniteEnd) -> Iterator[Check]:
    """Contacts with few nodes, or that may touch between nodes."""
    scene, state = end.scene, end.last
    for contact, here, _ in scene.contacts.each:
        side = contact.slave
        closed, gap = state.closed[here], state.gap[here]
        near = int(np.argmin(gap))
        spacing = float(side.weight[near])
        # A corner touches by one node, however fine nodes are.
        at_corners = np.isin(np.flatnonzero(closed), side.corners).all()
        coarser = "" if is_automatic(scene.case, contact) else ', or leave the spacing to "auto"'
        place = f"contact {contact.name}"
        if not closed.any():
            yield Check(
                "contact_between_nodes",
                float(between_nodes(side, state, here)),
                f"{place}: no node of {side.name} is in contact, but it may touch between its nodes, "
                f"{spacing:.3g} apart: use finer nodes there",
                place=place,
            )
            continue
        lean = _lean(side, closed, state.solver["normal"][here])
        leans = f", lateral error {100.0 * lean:.2g} %" if lean > MIN_LATERAL_SHARE else ""
        few = Check(
            "few_contact_nodes",
            np.inf if at_corners else int(closed.sum()),
            f"{place}: too few nodes of {side.name} in contact for accurate pressures ({closed.sum()}, "
            f"{spacing:.3g} apart){leans}: use finer nodes there{coarser}",
            place=place,
            warns=_least_nodes(side, closed),
        )
        yield few
        if few.outcome == "passed" and isinstance(contact, BodyContact) and closed.sum() < RESOLVED_NODES:
            yield from _ends(contact, closed, state.solver["place"][here])


def _least_nodes(side: ContactSide, closed: BoolArray) -> float:
    """Least number of ``closed`` nodes (c,): more if some are next to open ones of a smooth part of a side,
    of which half are behind a plane of symmetry."""
    ends = np.flatnonzero(closed & ~(np.roll(closed, 1) & np.roll(closed, -1)))
    mirrored = any(axis is not None and closed[end] for end, axis in zip((0, -1), side.mirrors, strict=True))
    free = not np.isin(ends, side.corners).all()
    return max(level("few_contact_nodes"), MIN_FREE_NODES / (2 if mirrored else 1) if free else 0.0)


def _lean(side: ContactSide, closed: BoolArray, normal: FloatArray) -> float:
    """Possible lateral part of the force on few ``closed`` nodes (c,): its place is known to half of their
    distance, over which the ``normal`` (c, 2) turns."""
    numbers = np.flatnonzero(closed)
    beside = (numbers[:, None] + np.array([-1, 1])) % side.count
    turned = np.hypot(*(normal[beside] - normal[numbers, None]).T)
    if side.around is None:
        turned = turned[(np.abs(beside - numbers[:, None]) == 1).T]
    return float(0.5 * turned.max(initial=0.0) / len(numbers))


def _ends(contact: BodyContact, closed: BoolArray, place: FloatArray) -> Iterator[Check]:
    """Ends of the master surface between nodes of the slave."""
    slave, master = contact.slave, contact.master
    if master.around is not None:
        return
    for number, end in ((0, master.arc[0]), (-1, master.arc[-1])):
        beside = np.flatnonzero(closed & (np.abs(place - end) < slave.weight))
        beside = beside[(beside > 0) & (beside < slave.count - 1)] if slave.around is None else beside
        free = beside[~closed[beside - 1] | ~closed[(beside + 1) % slave.count]]
        if len(free):
            x, y = master.places[number]
            yield Check(
                "contact_between_nodes",
                len(free),
                f"contact {contact.name}: the end of {master.name} at ({x:.6g}, {y:.6g}) presses between "
                f"nodes of {slave.name}, {slave.weight[free[0]]:.3g} apart: the position of its force is "
                f"uncertain by half of that",
                "use finer nodes there",
                f"contact {contact.name} at ({x:.6g}, {y:.6g})",
            )


def pointed(scene: FiniteScene, state: State) -> dict[str, float]:
    """Increase of the displacements of bodies held at single nodes when the spacing is halved, relative to
    the deformation."""
    found = {}
    forces, parts = SceneForces.of(scene, state), scene.parts(state.displacement)
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
    *(energy_estimate, estimates, refinement, few_contact_nodes),
    *COMMON,
)
"""Checks of a completed path at finite strain."""
