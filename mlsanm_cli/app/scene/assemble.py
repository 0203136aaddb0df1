"""The mechanical scene of a validated case on its clouds: pairs, supports, rigid motions, linear systems."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries, prescribes
from mlsanm_cli.app.scene.contact_pairs import check_tips, pair
from mlsanm_cli.app.scene.contact_ranges import contact_ranges, directed
from mlsanm_cli.app.scene.free_motions import Restrained, constrain_free_rigid_modes
from mlsanm_cli.app.scene.loads import Acting, acting
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.app.scene.rigid_constraints import rigid_constraints
from mlsanm_cli.case import Body, Case, Displacement, Platen
from mlsanm_cli.case.model.conditions import Kind, Support, compatible
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.contact.geometry.contact_grid import ContactRange
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_parts
from mlsanm_cli.errors import CaseError, CaseProblem, NumericalError
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody, Timed
from mlsanm_cli.mechanics.body_model import BodyModel, model_key
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.scene import Probe
from mlsanm_cli.mechanics.supports import restrained, restraining
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.operators.factors import LinearSolver
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF, ROUND_OFF

NOTHING: Mapping[str, Any] = MappingProxyType({})
HIGH_DEGREE, LOW_DEGREE = 4, 2
"""Degrees that "auto" selects."""
MIN_HIGH_NEIGHBORS = 30
"""Neighbours required by the high degree."""
MIN_HIGH_SPACINGS = 3.5
"""Spacings across all parts required by the high degree."""
MAX_SUPPORT_OFFSET = 1e-3
"""Distance from the point of a support to its node, in spacings, above which there is a note."""
ONE_CONDITION = "one condition per boundary and direction"
NO_CONDITION = (
    "only tractions and pressures may act on a contact surface: restrict both to different parts of it with "
    "from and to"
)


@dataclass(frozen=True)
class SceneModel:
    """A scene before its linear systems are assembled and factorised. ``boundaries`` are those of the case,
    ``held[body][surface]`` the fixed components, ``held_nodes[body]`` the fixed (node, component) pairs of
    single nodes, ``single_supports`` body and node by the name of their support, ``acting`` the loads,
    ``restrained`` the platens, obstacles and floating bodies with their free motions fixed at zero,
    ``probes`` the observed points, ``notes`` messages to the user, ``ranges`` the contacts that may have
    contact grids."""

    boundaries: Boundaries
    models: Mapping[str, BodyModel]
    pairings: tuple[Pairing, ...]
    held: Mapping[str, Mapping[str, tuple[bool, bool]]]
    held_nodes: Mapping[str, tuple[tuple[int, int], ...]]
    single_supports: Mapping[str, tuple[str, int]]
    acting: Acting
    probes: tuple[Probe, ...]
    restrained: Restrained
    notes: tuple[str, ...]
    ranges: Mapping[str, ContactRange]

    @property
    def clouds(self) -> Mapping[str, Cloud]:
        return {name: model.cloud for name, model in self.models.items()}


def mls_settings(case: Case, low: bool = False) -> MlsSettings:
    """Settings of the operators; ``low`` selects the low degree if the case leaves the degree open."""
    neighbors, degree, small = case.mls.neighbors, case.mls.degree, case.model.strain == "small"
    asked = neighbors if isinstance(neighbors, int) else None
    if degree == "auto":
        few = asked is not None and asked < MIN_HIGH_NEIGHBORS
        flows = any(case.material[body.material].flows for body in case.body)
        degree = LOW_DEGREE if low or few or flows else HIGH_DEGREE
    # Corner singularities are known for small strains of plane bodies only.
    return MlsSettings(degree, asked, corners=small and not case.model.revolved, narrow=small)


def prepare(
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    memo: Memo = NO_CACHE,
    before: Mapping[str, BodyModel] = NOTHING,
    grids: bool = True,
) -> SceneModel:
    """Stencils, pairs and conditions; models ``before`` are reused where cloud and degree are the same.
    ``grids``: contacts away from corners may have contact grids. Raises CaseError for contacts without facing
    nodes, for forces that nothing resists, for loads without a value at some node, and for supports and
    probes outside their body."""
    case = boundaries.case
    stiffness = materials(case)
    if case.model.revolved:
        _refuse_on_axis(boundaries, clouds, stiffness)
    held, fixed = _held_surfaces(boundaries, clouds)
    held_nodes, single, probes, notes = _given_points(case, clouds)
    refuse_conflicts(boundaries)
    loads = acting(case, boundaries.names, boundaries.drawn, clouds)
    pairings = tuple(pair(boundaries, clouds))

    def modelled(body: Body, low: bool) -> BodyModel:
        known, cloud, material = before.get(body.name), clouds[body.name], stiffness[body.material]
        settings = mls_settings(case, low)
        if known and known.cloud.content == cloud.content and known.settings.degree == settings.degree:
            return known
        build = partial(BodyModel.build, body.name, cloud, material, settings)
        return memo.value("model", model_key(body.name, cloud, material, settings), build)

    models = {}
    for body in case.body:
        # Nodes of meshes are not suited to wide stencils, and tips of slits are not smooth enough.
        cloud = clouds[body.name]
        difficult = cloud.sight is not None or cloud.spacings_across < MIN_HIGH_SPACINGS
        try:
            models[body.name] = modelled(body, body.has_nodes or difficult)
        except NumericalError:
            if mls_settings(case) == mls_settings(case, low=True):
                raise
            # Some part is too thin for the high degree.
            models[body.name] = modelled(body, low=True)
    restraints, occupied = dict[str, Any](), dict[str, Any]()
    for name, model in models.items():
        restraints[name] = restrained(held[name], loads.springs[name], model.cloud, model.material)
        sprung = restraining(loads.springs[name], model.cloud, model.material)
        occupied[name] = held[name] | dict.fromkeys(sprung)
    rigid = tuple(rigid_constraints(boundaries, clouds, held, held_nodes, restraints, loads.springs))
    # At finite strain knots are placed along sides of any kind; bodies of revolution have nodal pressures.
    small = case.model.strain == "small"
    if small:
        check_tips(case, pairings)
    grids = grids and small and not case.model.revolved
    ranges = contact_ranges(case, models, pairings, occupied, fixed, held_nodes) if grids else {}
    # Contacts with nodal pressures are less stable at higher degrees; tractions of bonds vary slowly.
    nodal = [pairing for pairing in pairings if not (pairing.bonded or pairing.name in ranges)]
    low_bodies = {name for pairing in nodal for name in pairing.bodies} if small else ()
    models |= {body.name: modelled(body, low=True) for body in case.body if body.name in low_bodies}
    try:
        free = constrain_free_rigid_modes(case, clouds, directed(pairings, ranges), rigid, loads, ranges)
    except CaseError:
        if not ranges:
            raise
        # The resisting part of a surface, for instance a chamfer, may lie outside the ranges.
        return prepare(boundaries, clouds, memo, before, grids=False)
    notes += free.notes
    if not small:
        reaching = [contact.name for contact in case.contact if contact.reach != "auto"]
        notes += [f"contact.{name}.reach has no effect at finite strain" for name in reaching]
    return SceneModel(
        boundaries, models, pairings, held, held_nodes, single, loads, probes, free, tuple(notes), ranges
    )


def _refuse_on_axis(
    boundaries: Boundaries, clouds: Mapping[str, Cloud], stiffness: Mapping[str, PlaneMaterial]
) -> None:
    """CaseError for conditions and contacts on the axis of revolution, but for supports in x, and for
    materials that are not the same in all directions about it, whose stress there is 0 or unbounded."""
    case, hint, problems = boundaries.case, "leave out the sides on x = 0", list[CaseProblem]()
    sides = [(name, side, s) for name, cloud in clouds.items() for side, s in cloud.surfaces.items()]
    axis = {(name, side) for name, side, surface in sides if clouds[name].on_axis(surface)}
    placed = [(key, place) for key, one, place in boundaries.conditions if prescribes(one) != (True, False)]
    for contact in case.contact:
        roles = zip(("slave", "master"), contact.sides, strict=False)
        placed += [(f"contact.{contact.name}.{role}", side) for role, side in roles]
    for key, place in placed:
        if any((place.body, name) in axis for name in boundaries.names[place]):
            problems.append(CaseProblem(key, "a side on the axis of revolution stays there", hint=hint))
    for number, body in enumerate(case.body):
        c, free = stiffness[body.material].stiffness, stiffness[body.material].free_expansion
        apart = max(abs(c[0, 0] - c[3, 3]), abs(c[0, 1] - c[1, 3])) / np.abs(c).max()
        uneven = apart > ROUND_OFF or abs(free[0] - free[3]) > ROUND_OFF * np.abs(free).max()
        if uneven and any(name == body.name for name, _ in axis):
            message = (
                f'material "{body.material}" differs along the radius and around the axis, which it touches'
            )
            hint = "E1 = E3, nu23 = nu12 E2 / E1, equal expansions, or a bore along the axis"
            problems.append(CaseProblem(f"body.{number}.material", message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))


def refuse_conflicts(boundaries: Boundaries) -> None:
    """Raises CaseError for conditions that exclude each other on a piece of a boundary, and for conditions
    other than tractions on a contact surface."""
    case = boundaries.case
    taken: dict[tuple[str, str], list[tuple[int, Kind, str, str, bool]]] = {}
    problems: dict[tuple[str, str], CaseProblem] = {}
    for key, condition, place in boundaries.conditions:
        owner = condition.label if isinstance(condition, Platen) else place.label
        outline = boundaries.outline(place.body)
        for name in boundaries.names[place]:
            acting = taken.setdefault((place.body, name), [])
            curve, normal = outline.curves[outline.names.index(name)], None
            if isinstance(curve, Segment):
                x, y = curve.normals(np.zeros(1))[0].tolist()
                normal = (x if abs(x) > FINE_ROUND_OFF else 0.0, y if abs(y) > FINE_ROUND_OFF else 0.0)
            kinds = list(condition.conditions(normal))
            for component, kind in kinds:
                for _, other, there, label, parted in [entry for entry in acting if entry[0] == component]:
                    if compatible(other, kind) and not (kind.startswith("platen") and label != owner):
                        continue
                    part = "a part of " if parted or place.ends else ""
                    where = f"{part}{place.body}.{name.partition('/')[0]} in {'xy'[component]}"
                    problem = CaseProblem(key, f"{key} and {there} both act on {where}", hint=ONE_CONDITION)
                    problems.setdefault((key, there), problem)
            acting += [(component, kind, key, owner, place.ends is not None) for component, kind in kinds]
    for contact in case.contact:
        for role, side in zip(("slave", "master"), contact.sides, strict=False):
            acting = [entry for name in boundaries.names[side] for entry in taken.get((side.body, name), ())]
            for _, kind, there, _, parted in acting:
                # Prescribed tractions and contact tractions add up.
                if kind != "traction":
                    key, part = f"contact.{contact.name}.{role}", "a part of " if parted or side.ends else ""
                    message = f"{there} acts on {part}the contact surface {side.label}"
                    problems.setdefault((key, ""), CaseProblem(key, message, hint=NO_CONDITION))
    if problems:
        raise CaseError(tuple(problems.values()))


def assemble_bodies(
    case: Case,
    prepared: SceneModel,
    solver: LinearSolver,
    timed: Timed = nullcontext,
    memo: Memo = NO_CACHE,
    before: Mapping[str, ElasticBody] = NOTHING,
) -> mechanics.Scene:
    """Assembles the system of every body; it is factorised within ``timed()`` on first use. Bodies
    ``before``, of the same case, are reused if their models are the same."""
    touching: dict[str, set[str]] = {name: set() for name in prepared.models}
    for pairing in prepared.pairings:
        if pairing.name not in prepared.ranges:
            parts = facing_parts(pairing.slave, pairing.position, pairing.normal)
            touching[pairing.slave_body].update(part.name for part, own, _ in parts if len(own))
            if pairing.master is not None and pairing.master_body is not None:
                touching[pairing.master_body].update(part.name for part, _ in pairing.master.members)
    bodies: dict[str, ElasticBody] = {}
    for name, model in prepared.models.items():
        known = before.get(name)
        if known is not None and known.model is model:
            bodies[name] = known
            continue
        held, nodes, springs = prepared.held[name], prepared.held_nodes[name], prepared.acting.springs[name]
        surfaces = tuple(sorted(touching[name]))
        build = partial(assemble, model, held, nodes, solver, springs, touching=surfaces)
        bodies[name] = memo.value("body", (model, held, nodes, springs, surfaces, solver), build)
        bodies[name].equations.timed = timed
    places = [support.place for support in case.support if support.place is not None]
    return mechanics.Scene(
        bodies=bodies,
        loads=case.moved,
        surface_loads=prepared.acting.surface_loads,
        rigid_constraints=prepared.restrained.rigid_constraints,
        supports={
            place.label: tuple((place.body, name) for name in prepared.boundaries.names[place])
            for place in places
        },
        held_nodes={
            name: (any(c == 0 for _, c in nodes), any(c == 1 for _, c in nodes))
            for name, nodes in prepared.held_nodes.items()
        },
        body_forces=prepared.acting.body_forces,
        heatings=prepared.acting.heatings,
        probes=prepared.probes,
        held_motions=prepared.restrained.held,
        loose_motions=prepared.restrained.loose,
        single_supports=prepared.single_supports,
    )


def _held_surfaces(
    boundaries: Boundaries, clouds: Mapping[str, Cloud]
) -> tuple[dict[str, dict[str, tuple[bool, bool]]], dict[str, set[str]]]:
    """The fixed components of the surfaces of every body, with those on the axis of revolution, which stay
    there; and the surfaces on which all prescribed displacements are zero."""
    held = {
        body: {name: (True, False) for name, surface in cloud.surfaces.items() if cloud.on_axis(surface)}
        for body, cloud in clouds.items()
    }
    fixed: dict[str, set[str]] = {body: set() for body in clouds}
    moving: dict[str, set[str]] = {body: set() for body in clouds}
    for _, condition, place in boundaries.conditions:
        x, y = prescribes(condition)
        still = isinstance(condition, Support)
        if isinstance(condition, Displacement):
            still = all(value in (None, 0.0) for value in condition.components)
        for surface in boundaries.names[place] if x or y else ():
            before = held[place.body].get(surface, (False, False))
            held[place.body][surface] = (before[0] or x, before[1] or y)
            (fixed if still else moving)[place.body].add(surface)
    return held, {body: names - moving[body] for body, names in fixed.items()}


def _given_points(
    case: Case, clouds: Mapping[str, Cloud]
) -> tuple[dict[str, tuple[tuple[int, int], ...]], dict[str, tuple[str, int]], tuple[Probe, ...], list[str]]:
    """The (node, component) pairs of every body that supports of single nodes fix, and the body and node of
    each of these by name; the probes; notes on supports whose node is not at the given point. CaseError for
    points outside their body."""
    pairs: dict[str, list[tuple[int, int]]] = {name: [] for name in clouds}
    single: dict[str, tuple[str, int]] = {}
    probes, notes, problems = list[Probe](), list[str](), list[CaseProblem]()
    for number, support in enumerate(case.support):
        if support.body is None or support.near is None:
            continue
        cloud, place = clouds[support.body], f"({support.near[0]:g}, {support.near[1]:g})"
        distances = np.hypot(*(cloud.points - np.array(support.near)).T)
        # The first of several nodes at the same distance up to round-off.
        least = distances.min() + ROUND_OFF * cloud.spacing.min()
        node = int(np.flatnonzero(distances <= least)[0])
        fixed = enumerate((support.ux, support.uy))
        pairs[support.body] += [(node, component) for component, value in fixed if value is not None]
        single[f"{support.body} near {place}"] = support.body, node
        (x, y), away = cloud.points[node].tolist(), float(distances[node])
        if away > cloud.spacing[node] and not cloud.contains(np.array([support.near]))[0]:
            message = f'{place} lies outside body "{support.body}"'
            hint = f"its nearest node is at ({x:g}, {y:g}), {away:.3g} away"
            problems.append(CaseProblem(f"support.{number}.near", message, hint=hint))
        elif away > MAX_SUPPORT_OFFSET * cloud.spacing[node]:
            near = f"the support of {support.body} near {place}"
            notes.append(f"{near} fixes the node at ({x:g}, {y:g}), {away:.3g} away")
    for probe in case.probe:
        point = np.array([probe.point])
        # Points on inclined sides are given to the digits that are written.
        if not clouds[probe.body].contains(point, COARSE_ROUND_OFF)[0]:
            message = f'({probe.point[0]:g}, {probe.point[1]:g}) lies outside body "{probe.body}"'
            hint = "give coordinates of the undeformed body"
            problems.append(CaseProblem(f"probe.{probe.name}.point", message, hint=hint))
        probes.append(Probe(probe.name, probe.body, point))
    if problems:
        raise CaseError(tuple(problems))
    return {name: tuple(held) for name, held in pairs.items()}, single, tuple(probes), notes
