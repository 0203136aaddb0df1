"""Forces that pull bodies away from their contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import AnyLoad, BodyForce, Case, Centrifugal, Platen, Traction
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.solve.condensed_scene import stage_factors


def pull_hint(case: Case, pairings: Sequence[Pairing]) -> str:
    """A hint on forces that pull bodies away from their contacts, "" if there are none."""
    forces = [(load, force) for load in case.load if (force := _force(load)) is not None]
    found = [
        f"load {load.name} pulls {load.owner} away from contact {pairing.name}"
        for load, force in forces
        for pairing in pairings
        if load.owner in pairing.bodies and (_normals(pairing, load.owner) @ force > 0.0).all()
    ]
    return f"{'; '.join(found)}: change its sign" if found else ""


def pulled_apart(case: Case, pairings: Sequence[Pairing]) -> Iterator[tuple[str, str, str]]:
    """Load, body and contact wherever nothing but one contact holds a body along the axis closest to its
    mean normal, from one side, and no force pushes, but one pulls along this axis at the end of a stage."""
    stages = [dict(zip(case.moved, values, strict=True)) for values in stage_factors(case)[1:].tolist()]
    for body in case.body:
        touching = [pairing for pairing in pairings if body.name in pairing.bodies]
        loads = [load for load in case.load if body.name in load.owners]
        forces = [(load.name, _force(load)) for load in loads]
        if len(touching) != 1 or touching[0].bonded:
            continue
        normals = _normals(touching[0], body.name)
        away = normals.mean(axis=0)
        axis = int(np.argmax(np.abs(away)))
        encloses = (normals[:, axis] * away[axis] <= 0.0).any()
        held = encloses or any(
            support.holds[axis] and body.name in (support.body, support.place and support.place.body)
            for support in case.support
        )
        controls = [load.control for load in loads if isinstance(load, Platen)]
        held |= any(control.get("xy"[axis], ("",))[0] == "displacement" for control in controls)
        known = [(name, away[axis] * force[axis]) for name, force in forces if force is not None]
        if held or len(known) < len(forces):
            continue
        for factors in stages:
            pulls = {name: factors.get(name, 0.0) * pull for name, pull in known}
            strongest = max(pulls, key=lambda name: pulls[name], default="")
            if strongest and pulls[strongest] > 0.0 <= min(pulls.values()):
                yield strongest, body.name, touching[0].name
                break


def _normals(pairing: Pairing, body: str) -> FloatArray:
    """The directions (m, 2) away from the paired nodes of a contact, of one of its bodies."""
    # The normal of a pairing, the master's outward one, points to the slave.
    return np.asarray(pairing.normal * (1.0 if body == pairing.slave_body else -1.0))


def _force(load: AnyLoad) -> FloatArray | None:
    """The direction of the force of a load, None if it is not given by numbers."""
    if isinstance(load, Platen):
        moved = load.control
        held = [moved.get(axis, ("force", 0.0)) for axis in "xy"]
        return np.array([value if how == "force" else 0.0 for how, value in held])
    given = load.traction or ("",) if isinstance(load, Traction) else ()
    given = load.body_force if isinstance(load, BodyForce | Centrifugal) else given
    numbers = [part for part in given if isinstance(part, int | float)]
    return np.array(numbers) if len(numbers) == 2 else None
