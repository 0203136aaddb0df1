"""Checks of states and paths at finite strain; the error of a path that cannot be continued."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import ANY, Check, level
from mlsanm_cli.app.checks.energy import (
    COMMON,
    NODE_FORCE_SHIFT,
    EnergyErrors,
    displacement_estimate,
    force_estimate,
    pressure_estimate,
    thin_part,
)
from mlsanm_cli.app.checks.overlaps import between_bodies, deepest, outline_of, overlap_check
from mlsanm_cli.app.finite.accuracy import energy_errors, work_error
from mlsanm_cli.app.finite.fields import body_forces, fields_of
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.membership import first_crossing
from mlsanm_cli.contact.finite.pair import RigidContact
from mlsanm_cli.contact.response.coercivity import CONTACT_LIMIT
from mlsanm_cli.continuation.path import Follower
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.laws.law import determinant
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import State

RECOMMENDED_REFINEMENT = 8.0
"""Factor by which the message of a large estimate of the energy proposes to refine."""
_LAWS = 'use law = "neo-hookean", which admits any compression, or smaller loads'


def deformation(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Volume ratio and ellipticity of every body."""
    when = f"at position {state.position:.6g}"
    for name, own in scene.parts(state.displacement).items():
        volume, place = _least_volume(scene, name, own)
        message = f"{place}: the deformation is not invertible {when} (det F = {volume:.3g})"
        hint = "use smaller loads, or finer nodes there"
        yield Check("volume_ratio", volume, message, hint, f"body {name}")
        waves, law = scene.bodies[name].ellipticity(own, state.factors), scene.bodies[name].law.name
        node = int(np.argmin(waves))
        lost = "has lost ellipticity" if waves[node] <= 0.0 else "is close to losing ellipticity"
        message = (
            f"{place_of(scene, name, node)}: {law} {lost} {when} (acoustic tensor {waves[node]:.3g} of the "
            f"shear modulus), where states are not unique"
        )
        yield Check("ellipticity", float(waves[node]), message, _LAWS, f"body {name}")


def overlap(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Boundaries inside their own body, another one, or an obstacle with which they have no contact."""
    if not scene.in_increments:
        return
    outlines = {}
    for name, own in scene.parts(scene.shown(state)).items():
        outline = outline_of(scene.bodies[name].elastic.model.cloud, own.reshape(-1, 2), exact=True)
        outlines[name], place = outline, first_crossing(outline.edges)
        near = "" if place is None else f"near ({place[0]:.6g}, {place[1]:.6g}) "
        when = f"at position {state.position:.6g}: self-contact is not supported"
        message = f"body {name} touches itself {near}{when}"
        hint = "use smaller loads, or model it as two bodies"
        yield Check("self_overlap", float(place is not None), message, hint, f"body {name}", fails=ANY)
    found = list(between_bodies(outlines))
    rigid = [one for one in scene.contacts.pairs if isinstance(one, RigidContact)]
    taken = {(one.slave.body, name) for one in rigid for name, _ in one.slave.nodes.members}
    for contact in rigid:
        body = contact.slave.body
        own_outline = outlines[body]
        free = ~np.array([(body, name) in taken for name in own_outline.names])[own_outline.surface]
        depth = -contact.seen(own_outline.points, own_outline.normal, state.driven)[0]
        deep = np.flatnonzero(free & (depth > own_outline.uncertainty))
        others = [f"the obstacle of contact {contact.name}"] * len(deep)
        found += deepest(own_outline, deep, depth[deep], body, others)
    hint = "add a [[contact]] between them, or use finer nodes there"
    yield overlap_check(found, state.position, lambda *_: hint)


def stability(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Stiffness of contacts against pressures that alternate from node to node."""
    value = float(state.solver.get("stability", np.inf))
    if value != np.inf:
        message = (
            f"the contact has almost no stiffness against pressures that alternate from node to node at "
            f"position {state.position:.6g} (stability {value:.2g}, below {CONTACT_LIMIT:g})"
        )
        hint = "choose the softer body, or the one with larger spacings, as the slave"
        yield Check("stability", value, message, f"{hint}; or use a more even cloud (lower growth)")


def equilibrium(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Motions that nothing resists in a state."""
    message = f"the equilibrium at position {state.position:.6g} is not stable: under these loads the bodies "
    message += "would buckle or snap into another state"
    hint = "prescribe displacements instead of forces, or add a small asymmetry that decides where bodies go"
    yield Check("equilibrium", float(state.solver.get("unstable", 0)), message, hint)


STATE: Sequence[Callable[[FiniteScene, State], Iterator[Check]]] = (
    deformation,
    overlap,
    stability,
    equilibrium,
)
"""Checks of every state."""


def _least_volume(scene: FiniteScene, name: str, displacement: FloatArray) -> tuple[float, str]:
    """Smallest det F at the nodes of a body, and its place."""
    volume = 1.0 + determinant(scene.bodies[name].gradient(displacement))
    node = int(np.argmin(volume))
    return float(volume[node]), place_of(scene, name, node)


def path_failure(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray, follower: Follower
) -> NumericalError:
    """Error of a path of one body that cannot be continued from its last state."""
    name, body = scene.alone
    waves = body.ellipticity(displacement, factors)
    soft = int(np.argmin(waves))
    where = f"the path stopped at position {position:.6g}: {follower.reason.value} ({follower.message})"
    if waves[soft] < level("ellipticity"):
        place = place_of(scene, name, soft)
        close = f"{place} is close to losing ellipticity (acoustic tensor {waves[soft]:.2g})"
        return NumericalError(f"{where}; {close}", _LAWS)
    volume, place = _least_volume(scene, name, displacement)
    hint = "use smaller loads, finer nodes, or raise solver.tolerance"
    return NumericalError(f"{where}; the smallest det F is {volume:.3g}, at {place}", hint)


def place_of(scene: FiniteScene, name: str, node: int) -> str:
    """A node of a body, in messages."""
    x, y = scene.bodies[name].elastic.model.cloud.points[node]
    return f"body {name}, node {node} at ({x:.6g}, {y:.6g})"


@dataclass(frozen=True)
class FiniteEnd:
    """A completed path: its ``last`` state, estimated ``errors``, and totals of the path (``tally``)."""

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
        forces = body_forces(self.scene, self.last)
        return {max(forces, key=lambda name: forces[name].rest): self.tally["balance"]}

    @cached_property
    def energies(self) -> EnergyErrors:
        """Work of the stresses less that of the forces, of the body where it is largest."""
        missing, bodies = self.tally["missing"], self.scene.bodies
        worst = max(missing, key=lambda name: abs(missing[name]), default=next(iter(bodies)))
        error = work_error(self.tally) * (-1.0 if missing.get(worst, 0.0) < 0.0 else 1.0)
        thin = {name: thin_part(body.elastic.model.cloud) for name, body in bodies.items()}
        series = not self.scene.in_increments and self.case.solver.method != "newton"
        name, what = "series_energy_error" if series else "energy_error", "the work of stresses in"
        # Increase of the displacements of bodies held at single nodes when the spacing is halved, relative to
        # the deformation.
        pointed, forces = {}, body_forces(self.scene, self.last)
        for body_name, own in self.scene.parts(self.last.displacement).items():
            body = bodies[body_name]
            nodes = body.elastic.held_nodes[: len(body.elastic.held_nodes) - body.pins]
            counts = np.array([sum(axis == one for _, one in nodes) for axis in (0, 1)])
            if not counts.any():
                continue
            cloud, angle = body.elastic.model.cloud, body.turn(own)
            force = np.where(counts, forces[body_name].total / np.maximum(counts, 1), 0.0)
            soft = body.elastic.model.material.contact_compliance(np.eye(2))
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            bent = cloud.points + own.reshape(-1, 2) - cloud.points @ turn.T
            most = np.abs(bent - cloud.areas @ bent / cloud.areas.sum()).max()
            shift = float((NODE_FORCE_SHIFT * soft * np.abs(force)).max())
            pointed[body_name] = shift / most if most else 0.0
        return EnergyErrors({worst: error}, {}, pointed, thin, name=name, what=what)


def energy_estimate(end: FiniteEnd) -> Iterator[Check]:
    """Estimated error of the energy by residuals: where it is largest, or that equations keep most of it."""
    estimate, message, hint = end.errors["energy"], "", ""
    if estimate > level("energy_estimate"):
        message = f"estimated error of the energy: {100.0 * estimate:.2g} % (forces may be as far off), "
        kept = end.tally["kept"] / end.tally["energy"]
        if kept > 0.5 * estimate:
            message += f"{100.0 * kept:.2g} % of it due to residuals that renewed equations keep next to "
            message, hint = f"{message}crushed corners", "make the loads smaller, or round these corners"
        else:
            nodal, size = energy_errors(end.scene, end.last)[0], end.scene.size
            body = max(nodal, key=lambda name: float(nodal[name].max()))
            cloud, node = end.scene.bodies[body].elastic.model.cloud, int(np.argmax(nodal[body]))
            x, y = np.round(cloud.points[node] / size, 9) * size + 0.0
            message += f"most of it at ({x:.6g}, {y:.6g}) of body {body}"
            hint = (
                f"refine there and at similar places, with slow growth, as in [[body.refine]] at = [{x:.6g}, "
                f"{y:.6g}], spacing = {cloud.spacing[node] / RECOMMENDED_REFINEMENT:.2g}, radius = 0, "
                f"growth = 0.1"
            )
    yield Check("energy_estimate", estimate, message, hint)


def estimates(end: FiniteEnd) -> Iterator[Check]:
    """Estimated errors of displacements, forces and pressures, and by the increments of friction."""
    forces, pressures = end.errors.get("contacts", {}), end.errors.get("pressure", {})
    yield from displacement_estimate(end.case, end.errors)
    for contact in end.scene.contacts.pairs:
        name, bodies = contact.name, [side.body for side in contact.sides]
        if name in forces:
            yield force_estimate("finite_force_error", end.case, name, bodies, forces[name])
        yield from pressure_estimate("rough_pressure_error", end.case, name, bodies, pressures.get(name))
    if "increments" in end.errors:
        error = end.errors["increments"]
        message = f"forces are estimated to be off by {100 * error:.2g} % by the increments of friction"
        hint = "use a smaller solver.increment_error or max_increment"
        yield Check("increment_error", error, message, hint)


def bifurcations(end: FiniteEnd) -> Iterator[Check]:
    """Bifurcations of the path: the first one, and where it leads."""
    found = [one for one in end.tally["bifurcations"] if not (one["followed"] and one["decided"])]
    message = hint = ""
    for first in found[:1]:
        (x, y), (u, v) = first["point"], first["direction"]
        how = f"in which body {first['body']} moves most at ({x:.6g}, {y:.6g}), along ({u:.3g}, {v:.3g})"
        message = f"stability is lost at position {first['position']:.6g}"
        if first["followed"]:
            message += f", where the path bifurcates: it goes on along the branch {how}; "
            message += "its mirror image may be as likely"
            hint = "a small asymmetry of shapes or loads decides on the branch"
        else:
            message += f" in a motion {how}: no stable state is near, and the bodies jump"
            hint = "prescribe displacements instead of forces, or end the path there"
    yield Check("bifurcation", float(len(found)), message, hint)


def located(end: FiniteEnd) -> Iterator[Check]:
    """Whether knots were placed for the whole path."""
    beyond = end.last.position - end.scene.located
    if beyond > 0.0:
        message = (
            f"contacts were located up to position {end.scene.located:.6g} only, where a path with coarse "
            "pressures stopped: patches of contact that come later are as coarse as the nodes"
        )
        hint = "use finer nodes where bodies touch, which are the first knots of pressures"
        yield Check("located_contacts", beyond, message, hint)


def folded(end: FiniteEnd) -> Iterator[Check]:
    """Nodes, next to singular points, where the fields shown are not invertible."""
    for name, fields in fields_of(end.scene, end.last).items():
        volume = fields["volume_ratio"]
        count, least = int((volume <= 0.0).sum()), int(np.argmin(volume))
        x, y = end.scene.bodies[name].elastic.model.cloud.points[least]
        message = f"body {name}: no stresses at {count} nodes, above all at ({x:.6g}, {y:.6g}), where the "
        message += f"deformation between nodes is not invertible (det F = {volume[least]:.3g})"
        yield Check("folded_nodes", float(count), message, "use finer nodes there", f"body {name}")


END: Sequence[Callable[[FiniteEnd], Iterator[Check]]] = (
    *(energy_estimate, estimates, located, bifurcations, folded),
    *COMMON,
)
"""Checks of a completed path at finite strain."""
