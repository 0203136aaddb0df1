"""Contact surfaces and obstacles at finite strain as lines, for ParaView."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.finite.fields import contact_values, stretch_along
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.output.lines import contact_data, obstacles
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.solve.state import State


def contact_lines(scene: FiniteScene, state: State) -> dict[str, VtuPart]:
    """Slave sides of all contacts in a state with their pressures; stresses act on the slave of the case."""
    records = contact_values(scene, state)
    lines = {}
    for contact, _, there in scene.contacts.each:
        record, side = records[contact.name], contact.slave
        moved = state.solver["surface"][there][: 2 * side.count].reshape(-1, 2)
        turn, _ = side.turned(moved)
        sign = -1.0 if contact.exchanged else 1.0
        normal = -sign * as_real(as_complex(side.outward) * turn)
        stretch = stretch_along(side, moved.ravel())
        stress = sign * state.side_traction[there].reshape(-1, 2)[: side.count] / stretch[:, None]
        numbers = np.arange(side.count, dtype=np.int64)
        edges = np.stack([numbers, np.roll(numbers, -1)], axis=1)
        edges = edges if side.around is not None else edges[:-1]
        data = contact_data(record, side.arc, bool(contact.friction))
        data |= {"displacement": moved, "normal": normal, "contact_stress": stress}
        lines[contact.name] = VtuPart(side.places, edges, data)
    return lines


def obstacle_lines(scene: FiniteScene, state: State) -> dict[str, VtuPart]:
    """Rigid obstacles in a state, by contact."""
    points = np.concatenate([body.elastic.model.cloud.points for body in scene.bodies.values()])
    drawn = obstacles(scene.case, points.min(axis=0), points.max(axis=0))
    lines = {}
    for contact in scene.contacts.pairs:
        if isinstance(contact, RigidContact):
            places, edges = drawn[contact.name]
            turned = (places - contact.pivot) @ contact.turn(state.driven).T
            moved = contact.pivot + contact.motion @ state.driven + turned - places
            lines[contact.name] = VtuPart(places, edges, {"displacement": moved})
    return lines
