"""Whether a state at finite strain has any sense, and what to say where a path breaks off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.exact import Pressed
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.continuation import Outcome
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.law import determinant
from mlsanm_cli.solve.load_factors import factors_at

FEWEST = 4
"""Nodes over a contact below which its pressures are hardly known."""
SHARP = 20
"""Nodes over a contact with which half of a spacing at its ends matters."""
FEW_WAVES = 0.1
"""Below this part of the shear modulus the acoustic tensor is so soft that a run warns."""
_LAWS = 'law = "neo-hookean" bears any compression; or smaller loads'


def check_deformation(scene: FiniteScene, position: float, displacement: FloatArray) -> None:
    """Raise NumericalError, with body and node, where det F <= 0 or the law has lost ellipticity in a state
    of the ``displacement`` (2N,) of all bodies."""
    for name, own in scene.parts(displacement).items():
        _check_body(scene, name, position, own)


def _check_body(scene: FiniteScene, name: str, position: float, displacement: FloatArray) -> None:
    body, factors = scene.bodies[name], factors_at(scene.stages, position)
    gradient = body.gradient(displacement)
    volume = 1.0 + determinant(gradient)
    node = int(np.argmin(volume))
    if not volume[node] > 0.0:
        raise NumericalError(
            f"{_place(scene, name, node)} is turned inside out at position {position:.6g}: "
            f"det F = {volume[node]:.3g}",
            "use smaller loads, or finer nodes there",
        )
    waves = body.ellipticity(displacement, factors)
    node = int(np.argmin(waves))
    if waves[node] <= 0.0:
        raise NumericalError(
            f"{_place(scene, name, node)}: {body.law.kind} has lost ellipticity at position {position:.6g} "
            f"(acoustic tensor {waves[node]:.3g} of the shear modulus): the state is not unique",
            _LAWS,
        )


def few_nodes(scene: FiniteScene, pressed: Pressed) -> Iterator[str]:
    """Warnings of contacts whose nodes are too far apart for what touches, or might touch between them."""
    first = 0
    for contact in scene.contacts:
        side, here = contact.slave, slice(first, first + contact.slave.count)
        first = here.stop
        name = f"{side.body}.{side.members[0][0].partition('/')[0]}"
        closed, gap = pressed.sets.closed[here], pressed.gap[here]
        near = int(np.argmin(gap))
        spacing = float(side.weight[near])
        if not closed.any():
            turned = np.abs(np.diff(side.outward[max(near - 1, 0) : near + 2], axis=0)).max(initial=0.0)
            if gap[near] < turned * spacing / 8.0:
                yield (
                    f"contact {contact.name}: no node of {name} touches, but between its nodes, "
                    f"{spacing:.3g} apart, it may: give {name} finer nodes there"
                )
        elif closed.sum() < FEWEST:
            yield (
                f"contact {contact.name}: only {closed.sum()} of the nodes of {name} touch, {spacing:.3g} "
                f"apart: pressures depend on that; give {name} finer nodes there"
            )
        elif isinstance(contact, BodyContact) and closed.sum() < SHARP:
            yield from _ends(contact, closed, pressed.place[here])


def _ends(contact: BodyContact, closed: BoolArray, place: FloatArray) -> Iterator[str]:
    """Warnings of ends of the master that press between nodes of the slave."""
    slave, master = contact.slave, contact.master
    if master.around is not None:
        return
    for number, end in ((0, master.arc[0]), (-1, master.arc[-1])):
        beside = np.flatnonzero(closed & (np.abs(place - end) < slave.weight))
        beside = beside[(beside > 0) & (beside < slave.count - 1)] if slave.around is None else beside
        free = beside[~closed[beside - 1] | ~closed[(beside + 1) % slave.count]]
        if len(free):
            x, y = master.places[number]
            one, other = (side.members[0][0].partition("/")[0] for side in (slave, master))
            yield (
                f"contact {contact.name}: the end of {master.body}.{other} at ({x:.6g}, {y:.6g}) presses "
                f"between nodes of {slave.body}.{one}, {slave.weight[free[0]]:.3g} apart: where is known to "
                f"half of that; give {slave.body}.{one} finer nodes there"
            )


def path_failure(
    scene: FiniteScene, position: float, displacement: FloatArray, outcome: Outcome
) -> NumericalError:
    """What to say of a path of one body that broke off behind its last state."""
    name, body = scene.alone
    gradient = body.gradient(displacement)
    volume = 1.0 + determinant(gradient)
    waves = body.ellipticity(displacement, factors_at(scene.stages, position))
    node, soft = int(np.argmin(volume)), int(np.argmin(waves))
    where = f"the path stopped at position {position:.6g}: {outcome.reason.value} ({outcome.message})"
    if waves[soft] < FEW_WAVES:
        place = _place(scene, name, soft)
        close = f"{place} is close to losing ellipticity (acoustic tensor {waves[soft]:.2g})"
        return NumericalError(f"{where}; {close}", _LAWS)
    least = f"the least det F is {volume[node]:.3g}, at {_place(scene, name, node)}"
    return NumericalError(f"{where}; {least}", "use smaller loads, finer nodes, or raise solver.tolerance")


def _place(scene: FiniteScene, name: str, node: int) -> str:
    x, y = scene.bodies[name].elastic.model.cloud.points[node]
    return f"body {name}, node {node} at ({x:.6g}, {y:.6g})"
