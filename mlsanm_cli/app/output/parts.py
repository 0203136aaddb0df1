"""Bodies, contacts and obstacles of either strain as parts of VTU files, and summary figures of contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case, DiskObstacle, ObstacleMotion, PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, STICK
from mlsanm_cli.contact.geometry.profile import half_width, is_singular
from mlsanm_cli.io.schema import COMPONENTS, CONTACT_ARRAYS, FIELDS
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.solve.state import Fields


class ContactNodes(NamedTuple):
    """Slave nodes of a contact before loading, in order along the surface: points (m, 2), outward normals of
    the master (m, 2), arc lengths and lengths (m,)."""

    points: FloatArray
    normal: FloatArray
    arc_length: FloatArray
    weight: FloatArray


def contact_figures(
    record: Mapping[str, Any],
    arc: FloatArray,
    pressure: FloatArray,
    force: FloatArray,
    axis: BoolArray | None = None,
) -> dict[str, Any]:
    """Summary figures from the quantities ``record`` of a contact, its ``pressure`` (c,) at ``arc`` lengths
    (c,), which are contiguous also on a closed surface, and its ``force`` (2,); ``axis`` (c,) marks nodes on
    an axis of revolution."""
    return {
        "peak_pressure": float(pressure.max(initial=0.0)),
        "half_width": half_width(arc, pressure, axis),
        "singular_ends": is_singular(arc, pressure),
        "force": force.tolist(),
        "closed_nodes": int((record["status"] != OPEN).sum()),
        "stick_nodes": int((record["status"] == STICK).sum()),
        "slip_nodes": int((record["status"] == SLIP).sum()),
        "min_gap": float(np.nanmin(record["gap"])),
        "dissipated_work": None if np.isnan(record["dissipated_work"]) else record["dissipated_work"],
    }


def vtu_states(
    clouds: Mapping[str, Cloud], fields: Mapping[str, Fields], wanted: Sequence[str]
) -> dict[str, VtuPart]:
    """The fields ``wanted`` at the points of ``clouds`` for VTU files, with the out-of-plane component of
    stresses, and principal values by number."""
    parts = {}
    for body, values in fields.items():
        data: dict[str, NDArray[Any]] = {}
        for name in wanted:
            field, axis = values[name], QUANTITIES[name].dimensions[-1]
            if axis == "principal":
                data |= {f"{name}_{part}": field[:, k] for k, part in enumerate(COMPONENTS[axis])}
            else:
                data[name] = np.column_stack([field, values["stress_zz"]]) if name == "stress" else field
        parts[body] = body_part(clouds[body], data)
    return parts


def body_part(cloud: Cloud, data: Mapping[str, NDArray[Any]]) -> VtuPart:
    """A body for VTU files, with nodal ``data`` and boundary tags: 0 inside, k on the k-th boundary with all
    its pieces; a corner node belongs to the later one."""
    tags, numbers = np.zeros(len(cloud.points), dtype=np.int32), dict[str, int]()
    for surface in cloud.surfaces.values():
        tags[surface.index] = numbers.setdefault(surface.name.partition("/")[0], len(numbers) + 1)
    return VtuPart(cloud.points, cloud.triangles, {"boundary_tag": tags, **data})


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
        bodies.append(body_part(cloud, data)._replace(cells=np.zeros((0, 3), dtype=np.int64)))
    return bodies


QUANTITIES = {entry.name: entry for entry in FIELDS}
PLANE_LENGTH = 0.75
"""Length of a plane to both sides, in diameters of the scene."""


def obstacles(case: Case, points: FloatArray) -> dict[str, tuple[FloatArray, IntArray]]:
    """Points (k, 2) and pairs of neighbours (e, 2) of the obstacle of every contact before loading. Planes
    are drawn with a length relative to the scene of these ``points`` (n, 2)."""
    low, high, lines = points.min(axis=0), points.max(axis=0), {}
    for contact in case.contact:
        obstacle = contact.obstacle
        if obstacle is None:
            continue
        if isinstance(obstacle, PlaneObstacle):
            normal, middle = np.array(obstacle.normal) / np.hypot(*obstacle.normal), 0.5 * (low + high)
            foot = middle - ((middle - np.array(obstacle.point)) @ normal) * normal
            reach = PLANE_LENGTH * float(np.hypot(*(high - low))) * np.array([normal[1], -normal[0]])
            drawn = np.array([foot - reach, foot + reach])
        elif isinstance(obstacle, DiskObstacle):
            angle = np.linspace(0.0, 2.0 * np.pi, 181)
            ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            drawn = np.array(obstacle.center) + obstacle.radius * ring
        else:
            drawn = np.array(obstacle.points)
        numbers = np.arange(len(drawn), dtype=np.int64)
        lines[contact.name] = drawn, np.stack([numbers[:-1], numbers[1:]], axis=1)
    return lines


def obstacle_shift(case: Case, contact: str, moved: Mapping[str, FloatArray]) -> FloatArray:
    """Displacement (2,) of an obstacle, from the displacements ``moved`` by load, which are all equal."""
    names = [load.name for load in case.load if isinstance(load, ObstacleMotion) and load.obstacle == contact]
    return next((moved[name] for name in names if name in moved), np.zeros(2))


def contact_part(
    points: FloatArray, edges: IntArray, record: Mapping[str, Any], friction: bool, **more: FloatArray
) -> VtuPart:
    """A contact surface with the arrays of the schema among the values of a ``record`` and ``more``."""
    values = {**record, **more, "status": record["status"].astype(np.int32)}
    # Without friction the slip is not computed; viewers cannot show nan.
    names = [name for name in CONTACT_ARRAYS if name in values and (friction or name != "slip")]
    return VtuPart(points, edges, {name: values[name] for name in names})
