"""Whether twice the strain energy of every body is the work of all that acts on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.assessment.checks import ENERGY_WARNING, EnergyVerdict, largest_force
from mlsanm_cli.app.scene.assemble import single_nodes
from mlsanm_cli.app.scene.causes import strain_of
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.response.work import work_on
from mlsanm_cli.mechanics.energy import energy_at_tips, energy_between_nodes, twice_strain_energy
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import Fields
from mlsanm_cli.solve.state import State

SMALL = 1e-3
"""A body with less than this part of all energy counts the less, the less it has."""
UNSTRAINED = 1e-6
"""Strains below this part of displacement over size are not judged: elastic systems pass that are solved to
no more."""
HEATED = 0.1
"""Nor are energies below this part of what would block all expansion of a heated body: free expansion has
none, and what a held end has away from its corners is little, and known poorly, where all else is right."""
MISSED = 0.3
"""Integrals miss so many times F^2/E' of the energy under a single node that exerts a force F, whatever the
spacing: 0.11 to 0.16 on a disk of 85 to 1,163 nodes that stands on one. Held in the middle it is some too
much on the coarsest of them."""
SHIFTED = 2.0 * np.log(2.0) / np.pi
"""Times F^2/E' the node sinks in further, in work, with half of the spacing, without end."""
BENT = 5
"""Nodes across parts that bend: with so many rings, cantilevers and portal frames are within 1.2 %, with 3 up
to 20 % too stiff."""
SMOOTH = 3
"""Degree from which energies of clamped bodies tell their errors better than fits of the next degree do."""
BENDING = 0.1
"""Nor do they where contacts on grids of their own do more than this part of the work by themselves."""
UNLOADED = 1e-3
"""Nor are forces below this part of those before, in a scene that is unloaded again: smooth contact laws
leave as much, on a few nodes, and contacts are solved to a tolerance relative to what was before."""


def energy_error(built: CondensedScene, state: State, fields: Mapping[str, Fields]) -> EnergyVerdict:
    """Compare the strain energy of every body with the work on it in one state, by its ``fields``."""
    energies, works, least, strains, pointed, thin, rests = {}, {}, {}, {}, {}, {}, {}
    near, squares = _near_work(built, state), _on_single_nodes(built, state)
    for name, body in built.scene.bodies.items():
        cloud, material, found = body.model.cloud, body.model.material, fields[name]
        single = single_nodes(built.case, name, cloud)
        rests[name] = rest = found.rest[: len(cloud.points)], found.stress - found.near
        moved = found.displacement - rest[0]
        strains[name] = strain_of(cloud.points, found.displacement, found.von_mises, material.modulus)
        energies[name] = twice_strain_energy(cloud, material, rest[1])
        energies[name] += energy_at_tips(body.model, rest[0], rest[1])
        works[name] = work_on(built.scene, built.condensed, name, state.unknowns, *rest, moved, single)
        thin[name] = thin_part(cloud)
        strain = UNSTRAINED * np.abs(found.displacement).max() / np.ptp(cloud.points, axis=0).max()
        degrees, free = built.scene.degrees(name, state.factors), material.expansion
        blocked = float(cloud.areas @ degrees**2) * float(free @ material.stiffness @ free)
        least[name] = near[name] + cloud.areas.sum() * material.modulus * strain**2 + HEATED * blocked
    # A body whose energy is no number must not hide which one it is.
    total = float(np.nansum([energies[name] + abs(works[name]) for name in works]))
    least_of_all = total * max(SMALL, _faded(built, state))
    errors = {}
    for name, work in works.items():
        # Unlike max of Python, that of numpy loses no nan.
        scale = float(np.max([abs(work), least_of_all, least[name]]))
        errors[name] = _relative(energies[name] - work, MISSED * squares[name], scale)
        if abs(errors[name]) > ENERGY_WARNING:
            # Two integrals of one energy: what only one of them misses is its own error.
            more = energy_between_nodes(built.scene.bodies[name].model, *rests[name])
            other = _relative(energies[name] + more - work, MISSED * squares[name], scale)
            errors[name] = min(errors[name], other, key=abs)
        pointed[name] = 0.0 if scale == 0.0 else SHIFTED * squares[name] / scale
    # What contacts press in is not seen in the mean: only bodies that bend are their energies' errors off.
    bent = {name: 0.0 if near[name] > BENDING * abs(work) else errors[name] for name, work in works.items()}
    worst = max(errors, key=lambda name: np.nan_to_num(abs(errors[name]), nan=np.inf))
    return EnergyVerdict(errors[worst], errors, strains, pointed, thin, _deflection(built, bent, fields))


def _relative(missing: float, unseen: float, scale: float) -> float:
    """What is ``missing`` beyond what integrals do not see, over the ``scale``."""
    return 0.0 if scale == 0.0 else float((missing - np.clip(missing, -unseen, unseen)) / scale)


def _deflection(built: CondensedScene, errors: Mapping[str, float], fields: Mapping[str, Fields]) -> float:
    """What the energy ``errors`` of bodies with clamped ends are of all displacements.

    Fits of the next degree see nothing of what singular ends take from smooth fits: of cantilevers and
    portal frames at degree 4 they told down to a thirtieth of the error, which that of the energy was within
    a third. Lower degrees they judge well, and integrals of energies poorly.
    """
    squares = {name: float((one.displacement**2).sum()) for name, one in fields.items()}
    lost = 0.0
    for name, body in built.scene.bodies.items():
        if body.model.settings.degree >= SMOOTH and any(map(all, body.gripped.values())):
            lost += errors[name] ** 2 * squares[name]
    whole = sum(squares.values())
    return float(np.sqrt(lost / whole)) if whole > 0.0 else 0.0


def thin_part(cloud: Cloud) -> str:
    """Where a body that bends has too few nodes across, and how many it wants; "" where it has enough."""
    thinnest = cloud.thinnest
    if thinnest.spacings > BENT - 1.5:
        return ""
    x, y = cloud.points[thinnest.node]
    size = thinnest.width / (BENT - 1)
    return (
        f"near ({x:.6g}, {y:.6g}), where it has {round(thinnest.spacings) + 1} nodes across: parts in "
        f"bending need {BENT} or more, a spacing of {size:.3g}"
    )


def _on_single_nodes(built: CondensedScene, state: State) -> dict[str, float]:
    """F^2/E' of what the single nodes that hold a body exert on it, shared evenly among them."""
    sums = built.condensed.sums
    if sums is None:
        return dict.fromkeys(built.scene.bodies, 0.0)
    forces, found = sums(*state.unknowns).reshape(-1, 2), {}
    for force, (name, body) in zip(forces, built.scene.bodies.items(), strict=True):
        contact_compliance = body.model.material.contact_compliance(np.eye(2))
        held = single_nodes(built.case, name, body.model.cloud)
        counts = [max(1, sum(component == axis for _, component in held)) for axis in (0, 1)]
        known = np.array([any(component == axis for _, component in held) for axis in (0, 1)])
        found[name] = float((known * contact_compliance * force**2 / counts).sum())
    return found


def _near_work(built: CondensedScene, state: State) -> dict[str, float]:
    """What contacts on grids of their own work on every body, as far as its softness has a part in them: with
    little of it in the rest, that rest need not be known well."""
    condensed = built.condensed
    gap = condensed.gap.pressure @ state.pressure + condensed.gap.traction @ state.traction
    slip = condensed.slip.pressure @ state.pressure + condensed.slip.traction @ state.traction
    found = dict.fromkeys(built.scene.bodies, 0.0)
    for pairing in condensed.pairings:
        if pairing.grid is None:
            continue
        span = condensed.spans[pairing.name]
        work = float(condensed.weight[span] @ (state.pressure[span] * gap[span]))
        if pairing.name in condensed.tangential:
            own = condensed.tangential[pairing.name]
            work += float(condensed.weight[span] @ (state.traction[own] * slip[own]))
        chosen = pairing.normal[pairing.candidate]
        contact_compliance = [
            float(built.scene.bodies[body].model.material.contact_compliance(chosen).mean())
            for body in pairing.bodies
        ]
        for body, part in zip(pairing.bodies, contact_compliance, strict=True):
            found[body] += abs(work) * part / sum(contact_compliance)
    return found


def _faded(built: CondensedScene, state: State) -> float:
    """How many times a state's energy goes into one that counts, besides those at the ends of the stages."""
    now = max(largest_force(built, name, state.unknowns) for name in built.scene.bodies)
    before = [
        largest_force(built, name, (end.factors, end.motion, end.pressure, end.traction))
        for name in built.scene.bodies
        for end in built.ends
    ]
    return (UNLOADED * max(before, default=0.0) / now) ** 2 if now > 0.0 else 0.0
