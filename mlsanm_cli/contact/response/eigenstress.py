"""Eigenstresses of bodies in a condensed scene: plastic strains, which change while loads do.

They change every quantity through the functionals of the displacements u that they cause, and through the
functionals' own part E::

    u = A^+ P s        seen = L u - E s        constants of all maps += H seen

H is the response to unit functionals, like the one to loads. Equation (33) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.responses import BodyResponses, functional_rows
from mlsanm_cli.mechanics.eigenstress import eigenstress_loads, fitted_around
from mlsanm_cli.mechanics.scene import RigidMotion, Scene
from mlsanm_cli.records import dataclass

NOTHING: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class Eigenstresses:
    """Maps from nodal eigenstresses (3n,) of the bodies that flow: right-hand sides ``loads`` (r, 3n),
    functionals ``rows`` (c, 2N) of displacements and their ``own`` (c, 3n) part; ``wide`` is the condensed
    scene with the functionals as loads after the first ``count``."""

    scene: Scene
    loads: Mapping[str, sparse.csr_array]
    rows: Mapping[str, sparse.csr_array]
    own: Mapping[str, sparse.csr_array]
    count: int
    wide: Condensed

    @classmethod
    def of(cls, responses: BodyResponses, wide: Condensed) -> Eigenstresses:
        """The maps of a scene's bodies."""
        scene, loads, rows, own = responses.scene, {}, {}, {}
        for name in flowing(scene):
            body = scene.bodies[name]
            columns = 3 * len(body.model.cloud.points)
            parts, around = dict[Any, sparse.csr_array](), partial(fitted_around, body.model)
            for surface in body.restrained:
                reaction = body.reaction(surface, scene.center(name, surface), around)
                parts["held", (name, surface)] = sparse.csr_array(reaction)
            for probe in scene.probes:
                if probe.body == name:
                    value = body.model.field_rows(probe.point)
                    moved = sparse.csr_array((2, columns))
                    parts["probe", probe.name] = sparse.vstack([moved, sparse.block_diag([value] * 3)])
            blocks = [
                parts.get(key, sparse.csr_array((place.stop - place.start, columns)))
                for key, place in responses.places.items()
            ]
            nothing = sparse.csr_array((0, columns))
            own[name] = sparse.csr_array(sparse.vstack([nothing, *blocks], format="csr"))
            loads[name] = eigenstress_loads(body)
            rows[name] = functional_rows(scene, responses.drivers, responses.places, name)
        return cls(scene, loads, rows, own, len(scene.loads), wide)

    def within(
        self,
        condensed: Condensed,
        stresses: Mapping[str, FloatArray],
        quick: bool = False,
        more: Mapping[str, FloatArray] = NOTHING,
    ) -> Condensed:
        """A ``condensed`` scene without eigenstresses under those given (n, 3); ``quick``: as accurate as the
        factors are; ``more`` are further right-hand sides (r,)."""
        inner, seen = {}, np.zeros(self.wide.gap.load.shape[1] - self.count)
        for name, stress in stresses.items():
            flat, system = stress.T.ravel(), self.scene.bodies[name].system
            source = self.loads[name] @ flat + more.get(name, 0.0)
            column = sparse.csc_array(source[:, None])
            moved = (system.correction(column) if quick else system.solve(column))[:, 0]
            inner[name] = source, moved
            seen = seen + self.rows[name] @ moved - self.own[name] @ flat
        changed = _mapped(condensed, self.wide, lambda own, by: own.shifted(by.load[:, self.count :] @ seen))
        found = replace(changed, inner=inner)
        # Whatever does not depend on constants, computed at most once.
        vars(found).update({name: getattr(condensed, name) for name in ("whole", "blocks", "problem")})
        return found


def flowing(scene: Scene) -> list[str]:
    """The bodies whose material flows."""
    return [name for name, body in scene.bodies.items() if body.model.material.flows]


def widened(scene: Scene, count: int) -> Scene:
    """The scene with as many further loads, which nothing responds to."""

    def wider(motion: RigidMotion) -> RigidMotion:
        more, given = np.zeros(count), motion.prescribed
        prescribed = None if given is None else np.append(given, more)
        return replace(motion, prescribed=prescribed, force=np.append(motion.force, more))

    constraints = tuple(
        replace(one, motions=tuple(map(wider, one.motions))) for one in scene.rigid_constraints
    )
    return replace(scene, loads=(*scene.loads, *[""] * count), rigid_constraints=constraints)


def narrowed(wide: Condensed, count: int) -> Condensed:
    """A condensed scene with the first loads only."""
    extra = np.s_[count : wide.gap.load.shape[1]]
    return replace(
        _mapped(wide, wide, lambda one, _: replace(one, load=one.load[:, :count])),
        drivers=replace(wide.drivers, loads=count),
        sources={
            name: sparse.csc_array(sparse.hstack([one[:, :count], one[:, extra.stop :]]))
            for name, one in wide.sources.items()
        },
        solutions={name: np.delete(one, extra, axis=1) for name, one in wide.solutions.items()},
    )


def _mapped(condensed: Condensed, other: Condensed, change: Any) -> Condensed:
    """A condensed scene with every linear map changed, given the same map of an ``other`` one."""
    names = ("gap", "slip", "watched", "balance")
    changes: dict[str, Any] = {name: change(getattr(condensed, name), getattr(other, name)) for name in names}
    changes["quantities"] = {
        kind: {key: change(one, other.quantities[kind][key]) for key, one in each.items()}
        for kind, each in condensed.quantities.items()
    }
    if condensed.bonds.pairings:
        tractions = change(condensed.bonds.tractions, other.bonds.tractions)
        changes["bonds"] = replace(condensed.bonds, tractions=tractions)
    return replace(condensed, **changes)
