"""Checks of every state at finite strain: deformations, and boundaries inside bodies and obstacles that no
contact prevents; the error of a path that cannot be continued."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.deformed import (
    DeformedOutline,
    Overlap,
    between_bodies,
    deepest,
    outline_of,
    overlap_check,
)
from mlsanm_cli.app.checks.limits import ANY, level
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import first_crossing
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.continuation import Follower
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.laws.law import determinant
from mlsanm_cli.solve.state import CONTACT_LIMIT, State

_LAWS = 'use law = "neo-hookean", which admits any compression, or smaller loads'


def deformation(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Volume ratio and ellipticity of every body."""
    for name, own in scene.parts(state.displacement).items():
        volume, place = _least_volume(scene, name, own)
        yield Check(
            "volume_ratio",
            volume,
            f"{place}: the deformation is not invertible at position {state.position:.6g} "
            f"(det F = {volume:.3g})",
            "use smaller loads, or finer nodes there",
            f"body {name}",
        )
        waves, law = scene.bodies[name].ellipticity(own, state.factors), scene.bodies[name].law.name
        node = int(np.argmin(waves))
        lost = "has lost ellipticity" if waves[node] <= 0.0 else "is close to losing ellipticity"
        yield Check(
            "ellipticity",
            float(waves[node]),
            f"{place_of(scene, name, node)}: {law} {lost} at position {state.position:.6g} (acoustic tensor "
            f"{waves[node]:.3g} of the shear modulus), where states are not unique",
            _LAWS,
            f"body {name}",
        )


def overlap(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Boundaries inside their own body, another one or an obstacle."""
    if not scene.in_increments:
        return
    outlines = {}
    for name, own in scene.parts(scene.shown(state)).items():
        cloud = scene.bodies[name].elastic.model.cloud
        outlines[name] = outline_of(cloud, own.reshape(-1, 2), exact=True)
        place = first_crossing(outlines[name].edges)
        near = "" if place is None else f"near ({place[0]:.6g}, {place[1]:.6g}) "
        yield Check(
            "self_overlap",
            float(place is not None),
            f"body {name} touches itself {near}at position {state.position:.6g}: self-contact is not "
            f"supported",
            "use smaller loads, or model it as two bodies",
            f"body {name}",
            fails=ANY,
        )
    found = [*between_bodies(outlines), *_with_obstacles(scene, outlines, state.driven)]
    hint = "add a [[contact]] between them, or use finer nodes there"
    yield overlap_check(found, state.position, lambda *_: hint)


def stability(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Stiffness of contacts against pressures that alternate from node to node."""
    value = float(state.solver.get("stability", np.inf))
    if value != np.inf:
        yield Check(
            "stability",
            value,
            f"the contact has almost no stiffness against pressures that alternate from node to node at "
            f"position {state.position:.6g} (stability {value:.2g}, below {CONTACT_LIMIT:g})",
            "choose the softer body, or the one with larger spacings, as the slave; or use a more even cloud "
            "(lower growth)",
        )


def equilibrium(scene: FiniteScene, state: State) -> Iterator[Check]:
    """Motions that nothing resists in a state."""
    yield Check(
        "equilibrium",
        float(state.solver.get("unstable", 0)),
        f"the equilibrium at position {state.position:.6g} is not stable: under these loads the bodies would "
        f"buckle or snap into another state",
        "prescribe displacements instead of forces, or add a small asymmetry that decides where bodies go",
    )


STATE: Sequence[Callable[[FiniteScene, State], Iterator[Check]]] = (
    deformation,
    overlap,
    stability,
    equilibrium,
)
"""Checks of every state."""


def _with_obstacles(
    scene: FiniteScene, outlines: dict[str, DeformedOutline], factors: FloatArray
) -> Iterator[Overlap]:
    """Overlaps with rigid obstacles of surfaces that have no contact with one, at load ``factors``."""
    rigid = [one for one in scene.contacts.pairs if isinstance(one, RigidContact)]
    taken = {(one.slave.body, name) for one in rigid for name, _ in one.slave.nodes.members}
    for contact in rigid:
        body = contact.slave.body
        own = outlines[body]
        free = ~np.array([(body, name) in taken for name in own.names])[own.surface]
        depth = -contact.seen(own.points, own.normal, factors)[0]
        deep = np.flatnonzero(free & (depth > own.uncertainty))
        others = [f"the obstacle of contact {contact.name}"] * len(deep)
        yield from deepest(own, deep, depth[deep], body, others)


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
    return NumericalError(
        f"{where}; the smallest det F is {volume:.3g}, at {place}",
        "use smaller loads, finer nodes, or raise solver.tolerance",
    )


def place_of(scene: FiniteScene, name: str, node: int) -> str:
    """A node of a body, in messages."""
    x, y = scene.bodies[name].elastic.model.cloud.points[node]
    return f"body {name}, node {node} at ({x:.6g}, {y:.6g})"
