"""Balances of forces and energies, their checks at either strain, and the energies of bodies that flow."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, Protocol

import numpy as np

from mlsanm_cli.app.checks.check import Check, level
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, finer_nodes
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.response.work import work_on
from mlsanm_cli.mechanics.energy import (
    energy_at_tips,
    energy_between_nodes,
    least_thermal_energy,
    over_body,
    twice_strain_energy,
)
from mlsanm_cli.mechanics.laws.von_mises import plastic_stress
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import UNLOADED, Fields, State

BENDING_NODES = 5
"""Nodes across parts required for bending."""
NODE_FORCE_SHIFT = 2.0 * np.log(2.0) / np.pi
"""Increase of the work, over F^2/E', by the displacement of the node with half the spacing, without limit."""


@dataclass(frozen=True)
class EnergyErrors:
    """By body the relative difference of twice the strain energy and the work, the strain, the increase of
    the work at single nodes with half the spacing (``pointed``) and parts with too few nodes across
    (``thin``). ``deflection`` is the root mean square error of displacements that only energies show,
    ``name`` the limit of the differences, ``what`` the quantity compared with the work."""

    bodies: Mapping[str, float]
    strains: Mapping[str, float] = field(default_factory=dict)
    pointed: Mapping[str, float] = field(default_factory=dict)
    thin: Mapping[str, str] = field(default_factory=dict)
    deflection: float = 0.0
    name: str = "energy_error"
    what: str = "twice the strain energy of"


class Ended(Protocol):
    """A completed path at either strain, with the missing forces and works of its bodies."""

    @property
    def case(self) -> Case: ...
    @property
    def imbalance(self) -> Mapping[str, float]: ...
    @property
    def energies(self) -> EnergyErrors: ...


def worst_of(errors: Mapping[str, float]) -> str:
    """The body with the error largest in magnitude, or with nan."""
    return max(errors, key=lambda name: np.nan_to_num(abs(errors[name]), nan=np.inf))


def balance(end: Ended) -> Iterator[Check]:
    """The body whose forces are farthest from adding up to zero."""
    if end.imbalance:
        name = worst_of(end.imbalance)
        error = end.imbalance[name]
        message = f"force imbalance on body {name}: {100 * error:.2g} % of the largest force"
        finer = finer_nodes(end.case, [name])
        hint = f"{finer} where it is held and around its notches, or use mls.degree = 4"
        yield Check("force_balance", error, message, hint, f"body {name}")


def work(end: Ended) -> Iterator[Check]:
    """The body whose energy differs most from the work done on it."""
    name = worst_of(end.energies.bodies)
    error = end.energies.bodies[name]
    size = f"{100 * abs(error):.2g} % {'below' if error < 0.0 else 'above'}"
    message = f"{end.energies.what} body {name} is {size} the work done on it"
    where = end.energies.thin.get(name) or "where it is held and around its notches"
    hint = f"{finer_nodes(end.case, [name])}, above all {where}"
    yield Check(end.energies.name, abs(error), message, hint, f"body {name}")


def single_nodes(end: Ended) -> Iterator[Check]:
    """Bodies held at single nodes, whose displacements depend on the spacing."""
    for name, part in end.energies.pointed.items():
        message = (
            f"body {name} is held at single nodes: displacements next to a point force are unbounded, and "
            f"grow by about {100 * part:.2g} % when its spacing is halved"
        )
        hint = (
            "support a part of a boundary (from, to), or measure displacements relative to another point "
            "than the fixed one"
        )
        yield Check("single_nodes", part, message, hint, f"body {name}")


def thin_part(cloud: Cloud) -> str:
    """Place where a body has too few nodes across for bending, and the spacing it needs ("" if none)."""
    across = cloud.spacings_across
    if across > BENDING_NODES - 1.5:
        return ""
    node = (cloud.widths / cloud.spacing).argmin()
    x, y = cloud.points[node]
    return (
        f"near ({x:.6g}, {y:.6g}), where it has {round(across) + 1} nodes across: parts in bending need "
        f"{BENDING_NODES} or more, a spacing of {cloud.widths[node] / (BENDING_NODES - 1):.3g}"
    )


def displacement_estimate(case: Case, figures: Mapping[str, Any]) -> Iterator[Check]:
    """The largest estimated error of displacements, of all or at a probe."""
    probes = figures.get("probes", {}).items()
    errors = {f"the displacement at probe {name} is": error for name, error in probes}
    if figures["displacement"] is not None:
        errors["displacements are"] = figures["displacement"]
    if errors:
        worst, finer = worst_of(errors), finer_nodes(case, [body.name for body in case.body])
        message = f"{worst} estimated to be off by {100 * errors[worst]:.2g} %"
        hint = f"{finer}, above all where bodies are held, loaded or bent"
        yield Check("displacement_error", errors[worst], message, hint)


def force_estimate(limit: str, case: Case, contact: str, bodies: Collection[str], error: float) -> Check:
    """Estimated error of the force of a contact that finer nodes in ``bodies`` reduce."""
    message = f"contact {contact}: its force is estimated to be off by {100 * error:.2g} %"
    hint = f"{finer_nodes(case, bodies)}, above all where bodies are held or touch"
    return Check(limit, error, message, hint, f"contact {contact}")


def pressure_estimate(
    limit: str, case: Case, contact: str, bodies: Collection[str], error: float | None, more: str = ""
) -> Iterator[Check]:
    """Estimated error of the pressures of a contact, if there is one; ``more`` of a hint."""
    if error is not None:
        message = f"contact {contact}: pressures are estimated to be off by {100 * error:.2g} %"
        yield Check(limit, error, message, f"{finer_nodes(case, bodies)}{more}", f"contact {contact}")


COMMON: Sequence[Callable[[Ended], Iterator[Check]]] = (balance, work, single_nodes)
"""Checks of a completed path at either strain."""


def force_balance(built: CondensedScene, state: State) -> dict[str, float]:
    """Resultant of all forces on each body over the largest force on it, in a state."""
    errors = {}
    for name, missing in built.condensed.quantities["imbalance"].items():
        largest = max(largest_force(built, name, state.unknowns), least_force(built, name))
        errors[name] = float(np.hypot(*missing(*state.unknowns))) / largest if largest else 0.0
    return errors


def largest_force(built: CondensedScene, body: str, unknowns: Sequence[FloatArray]) -> float:
    """Largest force on a body; magnitudes are summed, so that press fits and couples count."""
    condensed, (factors, _, pressure, _) = built.condensed, unknowns
    sizes = [
        float(condensed.areas[span] @ np.abs(pressure[span]))
        for pairing, span in zip(condensed.pairings, condensed.spans.values(), strict=True)
        if body in pairing.bodies
    ]
    for pairing in condensed.bonds.pairings:
        if body in pairing.bodies:
            size = np.hypot(*condensed.bonds.values(pairing.name, unknowns))
            sizes.append(float(pairing.areas[pairing.candidate] @ size))
    maps = [condensed.quantities["force"][load.name] for load in built.case.load if body in load.owners]
    sizes += [abs(factors[number]) * size for number, size in built.scene.sizes[body]]
    sizes.append(built.scene.heat_force(body, factors))
    return float(np.max([*sizes, *(np.hypot(*force(*unknowns)) for force in maps)]))


def least_force(built: CondensedScene, body: str) -> float:
    """Force below which those on a body are not checked, from the ends of stages: on it, and on all."""
    sizes = {
        name: max((largest_force(built, name, end.unknowns) for end in built.ends), default=0.0)
        for name in built.scene.bodies
    }
    return max(UNLOADED * sizes[body], ROUND_OFF * max(sizes.values()))


def force_mismatch(built: CondensedScene, state: State) -> dict[str, float]:
    """Difference of the forces on slave and master over the normal force, by contact."""
    errors = {}
    for name, span in built.condensed.spans.items():
        pressed = float(built.condensed.areas[span] @ np.abs(state.pressure[span]))
        lost = float(np.hypot(*built.condensed.quantities["mismatch"][name](*state.unknowns)))
        errors[name] = lost / pressed if pressed else 0.0
    return errors


MIN_ENERGY_SHARE = 1e-3
"""Bodies with less than this part of the total energy have an accordingly smaller weight."""
NODE_FORCE_ENERGY = 0.3
"""Energy under a single node that exerts a force F which the integrals miss, over F^2/E', at any
spacing."""
MIN_ENERGY_DEGREE = 3
"""Degree from which on energies estimate errors of clamped bodies better than fits of the next degree."""
MIN_BENDING_SHARE = 0.1
"""Not if contacts with contact grids do more than this part of the work by themselves."""


def energy_error(built: CondensedScene, state: State, fields: Mapping[str, Fields]) -> EnergyErrors:
    """Twice the strain energy of every body against the work done on it; of bodies that flow the work of
    their stresses on all strains, which is the same by virtual work."""
    energies, works, least, strains, pointed, thin, rests = {}, {}, {}, {}, {}, {}, {}
    near, squares = _near_work(built, state), dict[str, float]()
    for name, body in built.scene.bodies.items():
        cloud, material, found = body.model.cloud, body.model.material, fields[name]
        single = body.held_nodes
        # F^2/E' of the reactions at the single nodes that hold the body, which share them equally.
        force, compliance = built.condensed.quantities["sum"][name], material.contact_compliance(np.eye(2))
        held = [component for _, component in single]
        counts = np.array([held.count(0), held.count(1)])
        shares = (counts > 0) * compliance * force(*state.unknowns) ** 2 / np.maximum(counts, 1)
        squares[name] = float(shares.sum())
        stress = found["stress"]
        if material.revolved:
            stress = np.column_stack([stress, found["stress_zz"]])
        rests[name] = rest = found["rest"][: len(cloud.points)], stress - found["near"]
        moved = found["displacement"] - rest[0]
        # The range of displacements over the size, or a high quantile of stresses over the stiffness: the
        # largest stresses are those at corners, where they are unbounded.
        size = float(np.ptp(cloud.points, axis=0).max())
        apart = float(np.ptp(found["displacement"], axis=0).max()) / size
        strains[name] = max(apart, float(np.quantile(found["von_mises"], 0.99)) / material.modulus)
        turnover = 0.0
        if name in built.laws:
            compliant = np.linalg.inv(material.stiffness)
            strain = (rest[1] + plastic_stress(material, state.history(name))) @ compliant
            energies[name] = over_body(cloud, rest[1], strain)
            # The work that has been done remains when loads vanish.
            spent = np.abs(rest[1] * strain).sum(axis=1) + state.solver[f"work.{name}"]
            turnover = float(cloud.areas @ spent)
        else:
            energies[name] = twice_strain_energy(cloud, material, rest[1])
            energies[name] += energy_at_tips(body.model, rest[0], rest[1])
        works[name] = work_on(built.scene, built.condensed, name, state.unknowns, *rest, moved, single)
        thin[name] = thin_part(cloud)
        strained = COARSE_ROUND_OFF * np.abs(found["displacement"]).max() / size
        least[name] = max(turnover, near[name] + cloud.volumes.sum() * material.modulus * strained**2)
        least[name] += least_thermal_energy(body.model, built.scene.degrees(name, state.factors))
    # An energy that is nan must not affect other bodies.
    total = float(np.nansum([energies[name] + abs(works[name]) for name in works]))
    # After unloading, the largest forces at the ends of stages set the scale.
    now = max(largest_force(built, name, state.unknowns) for name in works)
    faded = (max(least_force(built, name) for name in works) / now) ** 2 if now > 0.0 else 0.0
    least_of_all = total * max(MIN_ENERGY_SHARE, faded)
    errors = {}
    for name, work in works.items():
        # Unlike the built-in max, np.max propagates nan.
        scale = float(np.max([abs(work), least_of_all, least[name]]))
        errors[name] = _relative(energies[name] - work, NODE_FORCE_ENERGY * squares[name], scale)
        if abs(errors[name]) > level("energy_error") and name not in built.laws:
            # Of two quadratures of the same energy the better one counts.
            more = energy_between_nodes(built.scene.bodies[name].model, *rests[name])
            other = _relative(energies[name] + more - work, NODE_FORCE_ENERGY * squares[name], scale)
            errors[name] = min(errors[name], other, key=abs)
        pointed[name] = 0.0 if scale == 0.0 else NODE_FORCE_SHIFT * squares[name] / scale
    # Fits of the next degree do not show the errors of smooth fits at singular ends, energies do; errors of
    # local indentation do not affect mean displacements, those of bending do.
    lost, whole = 0.0, 0.0
    for name, body in built.scene.bodies.items():
        square = float((fields[name]["displacement"] ** 2).sum())
        clamped = body.model.settings.degree >= MIN_ENERGY_DEGREE and any(map(all, body.restrained.values()))
        bent = near[name] <= MIN_BENDING_SHARE * abs(works[name])
        lost, whole = lost + (clamped and bent) * errors[name] ** 2 * square, whole + square
    deflection = float(np.sqrt(lost / whole)) if whole > 0.0 else 0.0
    result = EnergyErrors(errors, strains, pointed, thin, deflection)
    return replace(result, what="the work of stresses on strains of") if built.laws else result


def _relative(missing: float, unseen: float, scale: float) -> float:
    """Difference beyond the part ``unseen`` by quadrature, relative to ``scale``."""
    return 0.0 if scale == 0.0 else float((missing - np.clip(missing, -unseen, unseen)) / scale)


def _near_work(built: CondensedScene, state: State) -> dict[str, float]:
    """Work of contacts with contact grids on every body: the rest need not be accurate beside it."""
    condensed = built.condensed
    gap = condensed.gap.pressure @ state.pressure + condensed.gap.traction @ state.traction
    slip = condensed.slip.pressure @ state.pressure + condensed.slip.traction @ state.traction
    found = dict.fromkeys(built.scene.bodies, 0.0)
    for pairing in condensed.on_grids:
        span = condensed.spans[pairing.name]
        work = float(condensed.areas[span] @ (state.pressure[span] * gap[span]))
        if pairing.name in condensed.tangential:
            own = condensed.tangential[pairing.name]
            work += float(condensed.areas[span] @ (state.traction[own] * slip[own]))
        chosen = pairing.normal[pairing.candidate]
        materials = [built.scene.bodies[body].model.material for body in pairing.bodies]
        soft = [float(material.contact_compliance(chosen).mean()) for material in materials]
        for body, part in zip(pairing.bodies, soft, strict=True):
            found[body] += abs(work) * part / sum(soft)
    return found


def flow_figures(built: CondensedScene, state: State) -> dict[str, Any]:
    """The error of the increments, and of every body that flows its largest plastic strain, the part of its
    area with any, the work of plastic strains, of which back stresses store a part, and the stored energy."""
    bodies = {}
    for name, law in built.laws.items():
        cloud, history = built.scene.bodies[name].model.cloud, state.history(name)
        stress, plastic = state.solver[f"stress.{name}"], history[:, :4]
        tensor = np.array([1.0, 1.0, 1.0, 0.5])
        back = law.hardening.kinematic / 3.0 * over_body(cloud, plastic * tensor, plastic)
        bodies[name] = {
            "plastic_strain": float(history[:, 4].max()),
            "plastic_area": float(cloud.areas @ (history[:, 4] > 0.0) / cloud.areas.sum()),
            "plastic_work": float(cloud.areas @ state.solver[f"work.{name}"]),
            "stored_energy": 0.5 * over_body(cloud, stress, law.elastic_strain(stress)) + back,
        }
    if not bodies:
        return {}
    return {"flow": {"increment_error": float(state.solver["errors"][0]), "bodies": bodies}}
