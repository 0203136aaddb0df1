"""Conversion of states of the path into stored data: rows of run.h5, fields, tables, summary figures.

Fields are written at the nodes and, under contact grids, at points as fine as the grids. Fields between the
nodes are known: a smooth remainder and a closed form. The largest stress lies a part of the contact's width
below the surface, where the cloud may have no node.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from mlsanm_cli.app.output.writer import body_datasets, contact_datasets
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.profile import half_width, is_singular
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.io.records import ContactRecord, place, row
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.probes import probe_rows, stress_of_expansion
from mlsanm_cli.memo import NO_CACHE, Memo, digest
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import Fields
from mlsanm_cli.solve.functionals import platen_displacements, probe_record, slave_arc
from mlsanm_cli.solve.state import State

PER_HALF_WIDTH = 12.0
"""Points over the half-width of a contact patch."""
FINE_RADIUS, GROWTH = 1.5, 0.25
"""Radius of the fine zone in half-widths, and growth of the spacing beyond it."""
MAX_PATCHES = 12
"""Largest number of patches of a contact with fine points, the widest first."""
MIN_REFINEMENT = 0.7
"""Zones whose spacing is above this part of that of the cloud are omitted."""


@dataclass(frozen=True)
class View:
    """The points of a ``cloud`` at which the fields of a body of a ``model`` are written."""

    model: BodyModel
    cloud: Cloud

    @cached_property
    def rows(self) -> sparse.csr_array:
        """Displacement x and y and stresses xx, yy, xy at the points (5e, 2N), quantity by quantity."""
        return probe_rows(self.model, self.cloud.points)


@dataclass(frozen=True)
class Views:
    """The points at which the fields of every body are written: ``clouds``, and the bodies that have finer
    points than their nodes there."""

    clouds: Mapping[str, Cloud]
    finer: Mapping[str, View]

    @classmethod
    def of(cls, built: CondensedScene, memo: Memo = NO_CACHE) -> Views:
        """Finer points for the bodies whose clouds are too coarse for their contact patches at the ends of
        stages. Scenes with the same patches share them by the ``memo``."""
        clouds, finer, boundaries = {}, {}, Boundaries.of(built.case)
        for body in built.case.body:
            model = built.scene.bodies[body.name].model
            clouds[body.name] = model.cloud
            zones = () if body.has_nodes else tuple(_zones(built.condensed, built.ends, model))
            if zones:
                spacing = spacing_of(built.case, boundaries, body).with_zones(zones)
                cloud = build_cloud(boundaries.outline(body.name), spacing, body.seed, memo=memo)
                view = memo.value("view", digest(model.content, cloud.content), partial(View, model, cloud))
                clouds[body.name], finer[body.name] = view.cloud, view
        return cls(clouds, finer)


def _zones(condensed: Condensed, ends: Sequence[ExactState], model: BodyModel) -> Iterator[Zone]:
    for pairing in condensed.pairings:
        if pairing.grid is None:
            continue
        span = condensed.spans[pairing.name]
        closed = np.any([state.active[span] for state in ends], axis=0)
        patches = sorted(_patches(pairing.grid, closed), key=lambda patch: patch[0] - patch[1])[:MAX_PATCHES]
        for body, slave, _ in pairing.sides:
            if body != model.name:
                continue
            for first, last in patches:
                half = 0.5 * (last - first)
                place = pairing.grid.facing.side(np.array([0.5 * (first + last)]), slave)[0][0]
                nearest = model.tree.query([place.real, place.imag])[1]
                if (
                    half / PER_HALF_WIDTH
                    < MIN_REFINEMENT * model.cloud.spacing[min(nearest, len(model.cloud.points) - 1)]
                ):
                    point = (float(place.real), float(place.imag))
                    yield Zone.around(point, half / PER_HALF_WIDTH, FINE_RADIUS * half, GROWTH)


def _patches(grid: ContactGrid, closed: BoolArray) -> list[tuple[float, float]]:
    """Start and end of the runs of ``closed`` grid nodes (m,)."""
    steps = np.diff(np.concatenate([[False], closed, [False]]).astype(np.int64))
    firsts, lasts = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) + 1
    nodes = grid.hats.nodes
    return [(float(nodes[a]), float(nodes[b])) for a, b in zip(firsts, lasts, strict=True)]


def model_datasets(built: CondensedScene, clouds: Mapping[str, Cloud]) -> dict[str, Value]:
    """Bodies and contacts before loading."""
    found: dict[str, Value] = {}
    for name, cloud in clouds.items():
        found |= body_datasets(name, cloud, built.scene.bodies[name].model.settings.degree)
    for pairing in built.condensed.reported:
        normal, weight = pairing.normal[pairing.candidate], pairing.weight[pairing.candidate]
        points, arc = pairing.points[pairing.candidate], slave_arc(pairing)
        found |= contact_datasets(pairing.name, points, normal, arc, weight)
    bonds = built.condensed.bonds
    for name, own in bonds.spans.items() if bonds.pairings else ():
        pair = (bonds.pressure.take(own), bonds.traction.take(own))
        found[place("maps", "bonds", name)] = np.concatenate([one.matrix for one in pair])
    return found


def operators_digest(built: CondensedScene) -> str:
    """A digest of the condensed operators, which without the loads determine the path."""
    condensed = built.condensed
    maps = (condensed.gap, condensed.slip, condensed.watched, condensed.balance)
    return digest(maps, condensed.weight)


def map_datasets(built: CondensedScene) -> dict[str, Value]:
    """The maps from the unknowns of the series to forces, slips and the values of probes."""
    condensed = built.condensed
    slips = {name: condensed.slip.take(own) for name, own in condensed.tangential.items()}
    kinds = (("forces", condensed.forces), ("slip", slips), ("probes", condensed.probes))
    return {place("maps", kind, name): one.matrix for kind, maps in kinds for name, one in maps.items()}


def contact_record(built: CondensedScene, pairing: Pairing, state: State) -> ContactRecord:
    """One contact in one state. Without friction there is no traction, and slip is not computed (nan)."""
    if pairing.bonded:
        return _bond_record(built, pairing, state)
    span = built.condensed.spans[pairing.name]
    count = span.stop - span.start
    traction, slip, work = np.zeros(count), np.full(count, np.nan), 0.0
    if pairing.name in built.condensed.tangential:
        own = built.condensed.tangential[pairing.name]
        traction, slip = state.traction[own], state.slip[own]
        work = float(built.condensed.weight[span] @ state.work[own])
    return ContactRecord(
        pressure=state.pressure[span],
        traction=traction,
        gap=state.gap[span],
        slip=slip,
        status=state.status[span],
        dissipated_work=work,
    )


def _bond_record(built: CondensedScene, pairing: Pairing, state: State) -> ContactRecord:
    """The same of bonded surfaces: they stick, whatever they carry."""
    pressure, traction = built.condensed.contact_values(pairing, state.unknowns)
    nothing = np.zeros(len(pressure))
    sticking = np.full(len(pressure), STICK, dtype=np.int8)
    return ContactRecord(pressure, traction, nothing, nothing, sticking, 0.0)


def cone_ratio(built: CondensedScene, contact: str, state: State) -> float:
    """Largest of |t| / (mu p) over the closed nodes of a contact with friction."""
    span, own = built.condensed.spans[contact], built.condensed.tangential[contact]
    pressure = state.pressure[span]
    pressed = state.closed[span] & (pressure > ROUND_OFF * pressure.max(initial=0.0))
    limit = built.condensed.friction[own][pressed] * pressure[pressed]
    return float((np.abs(state.traction[own][pressed]) / limit).max(initial=0.0))


def step_row(built: CondensedScene, state: State, path: Mapping[str, float]) -> dict[str, Any]:
    """One row of the path: a value for every column of run.h5, the figures of its step those of ``path``."""
    return row(
        path=path,
        factors={name: float(f) for name, f in zip(built.scene.loads, state.factors, strict=True)},
        resultants={name: force(*state.unknowns) for name, force in built.condensed.forces.items()},
        displacements=platen_displacements(built, state),
        contacts={p.name: contact_record(built, p, state) for p in built.condensed.reported},
        probes={name: probe_record(built, name, state) for name in built.condensed.probes},
    )


def interface_columns(built: CondensedScene, pairing: Pairing, state: State) -> dict[str, Any]:
    """Columns of a contact's CSV."""
    record = contact_record(built, pairing, state)
    points = pairing.points[pairing.candidate]
    return {
        "x": points[:, 0],
        "y": points[:, 1],
        "arc_length": slave_arc(pairing),
        "gap": record.gap,
        "pressure": record.pressure,
        "traction": record.traction,
        "slip": record.slip,
        "status": record.status,
    }


def contact_summary(built: CondensedScene, pairing: Pairing, state: State) -> dict[str, Any]:
    """The engineer's figures of a contact."""
    record = contact_record(built, pairing, state)
    force = built.condensed.contact_forces[pairing.name](*state.unknowns)
    if pairing.bonded:
        return {
            "peak_pressure": float(record.pressure.max(initial=0.0)),
            "peak_tension": float(-record.pressure.min(initial=0.0)),
            "peak_traction": float(np.abs(record.traction).max(initial=0.0)),
            "force": force.tolist(),
            "closed_nodes": len(record.pressure),
            "stick_nodes": len(record.pressure),
        }
    return record_summary(record, slave_arc(pairing), record.pressure, force)


def record_summary(
    record: ContactRecord, arc: FloatArray, pressure: FloatArray, force: FloatArray
) -> dict[str, Any]:
    """Summary figures from the ``record`` of a contact, its ``pressure`` (c,) at ``arc`` lengths (c,), which
    are contiguous also on a closed surface, and its ``force`` (2,)."""
    return {
        "peak_pressure": float(pressure.max(initial=0.0)),
        "half_width": half_width(arc, pressure),
        "singular_ends": is_singular(arc, pressure),
        "force": force.tolist(),
        "closed_nodes": int((record.status != OPEN).sum()),
        "stick_nodes": int((record.status == STICK).sum()),
        "slip_nodes": int((record.status == SLIP).sum()),
        "min_gap": float(np.nanmin(record.gap)),
        "dissipated_work": None if np.isnan(record.dissipated_work) else record.dissipated_work,
    }


def shown_fields(
    built: CondensedScene, views: Views, state: State, fields: Mapping[str, Fields], stress: bool
) -> dict[str, Fields]:
    """The fields at the points where they are written, with stresses if requested."""
    return {
        name: _shown(built, views.finer[name], state, values, stress) if name in views.finer else values
        for name, values in fields.items()
    }


def _shown(built: CondensedScene, view: View, state: State, fields: Fields, stress: bool) -> Fields:
    name, material = view.model.name, view.model.material
    moved, stressed = built.condensed.contact_fields(built.scene, name, state.unknowns, view.cloud.points)
    seen = (view.rows @ fields.rest.ravel()).reshape(5, -1).T
    sigma, degrees = np.zeros((0, 3)), np.zeros(0)
    if stress:
        degrees = built.scene.degrees(name, state.factors, view.cloud.points)
        sigma = seen[:, 2:] + stressed - degrees[:, None] * stress_of_expansion(material)
    across = material.out_of_plane_stress(sigma, degrees)
    strain = material.strain(sigma, degrees)
    shown = seen[:, :2] + moved, sigma, across, von_mises(sigma, across), strain
    return Fields(*shown, fields.rest, stressed)


def stored_fields(number: int, fields: Mapping[str, Any], wanted: Sequence[str]) -> dict[str, Value]:
    """The requested fields of the saved state with this number, as datasets."""
    return {
        place("fields", str(number), body, name): np.ascontiguousarray(getattr(values, name))
        for body, values in fields.items()
        for name in wanted
    }


def vtu_states(
    clouds: Mapping[str, Cloud], fields: Mapping[str, Fields], wanted: tuple[str, ...]
) -> dict[str, VtuPart]:
    """The requested fields at the points of ``clouds``, for VTU files."""
    return {name: body_part(clouds[name], vtu_data(values, wanted)) for name, values in fields.items()}


def vtu_data(fields: Any, wanted: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The requested fields by name, with the out-of-plane component of stresses."""
    data = {name: getattr(fields, name) for name in wanted}
    return {
        name: np.column_stack([values, fields.stress_zz]) if name == "stress" else values
        for name, values in data.items()
    }


def body_part(cloud: Cloud, data: Mapping[str, NDArray[Any]]) -> VtuPart:
    """A body for VTU files, with nodal ``data`` and the numbers of its boundaries."""
    return VtuPart(cloud.points, cloud.triangles, {"boundary_tag": boundary_tags(cloud), **data})


def boundary_tags(cloud: Cloud) -> NDArray[np.int32]:
    """0 inside, k on the k-th boundary with all its pieces; a corner node belongs to the later one."""
    tags = np.zeros(len(cloud.points), dtype=np.int32)
    numbers: dict[str, int] = {}
    for surface in cloud.surfaces.values():
        tags[surface.index] = numbers.setdefault(surface.name.partition("/")[0], len(numbers) + 1)
    return tags


def model_bodies(prepared: SceneModel) -> list[VtuPart]:
    """The nodes of all bodies with tags, spacings, outward normals (zero inside) and, for contact candidates,
    the vectors to their projections."""
    bodies = []
    for name, model in prepared.models.items():
        cloud = model.cloud
        normal, partner = np.zeros_like(cloud.points), np.zeros_like(cloud.points)
        for surface in cloud.surfaces.values():
            normal[surface.index] = surface.normal
        for pairing in prepared.pairings:
            if pairing.slave_body == name:
                node = pairing.node[pairing.candidate]
                partner[node] = pairing.partner[pairing.candidate] - cloud.points[node]
        data = {"spacing": cloud.spacing, "normal": normal, "partner": partner}
        bodies.append(replace(body_part(cloud, data), cells=np.zeros((0, 3), dtype=np.int64)))
    return bodies
