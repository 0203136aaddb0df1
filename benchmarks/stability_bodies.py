"""Random bodies without contact for stability.py: scenes, their clouds, errors on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import Outline, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.stability import bulk_stability
from mlsanm_cli.operators.neighbors import MlsSettings
from tests.mechanics.bodies import boundary_values, with_body_force
from tests.mechanics.waves import Wave

FIELDS = 4


@dataclass(frozen=True)
class Scene:
    """One body without contact, up to the random numbers of its cloud."""

    outline: Outline
    center: tuple[float, float]
    length: float
    spacing: Spacing
    poisson: float
    plane: str
    clamped: str | None
    jitter: float
    waves: int


def random_scene(rng: np.random.Generator) -> Scene:
    """A scene of 300 to 2000 nodes."""
    kind = rng.choice(["rectangle", "disk", "half-disk", "sector"])
    center, length = (0.0, 0.0), 2.0
    if kind == "rectangle":
        width = 2.0 ** rng.uniform(-2.0, 2.0)
        outline, area = rectangle((0.0, width), (0.0, 1.0)), width
        center, length = (0.5 * width, 0.5), max(width, 1.0)
    elif kind == "disk":
        outline, area = disk((0.0, 0.0), 1.0), math.pi
    elif kind == "half-disk":
        outline, area = half_disk((0.0, 0.0), 1.0, "lower"), 0.5 * math.pi
    else:
        inner, angle = rng.uniform(0.2, 0.8), rng.uniform(0.5, 5.0)
        outline, area = sector((0.0, 0.0), (inner, 1.0), (0.0, angle)), 0.5 * angle * (1.0 - inner**2)
    h = math.sqrt(area / rng.uniform(300.0, 1500.0))
    grading = 10.0 ** rng.uniform(0.0, 2.0)
    curve = outline.curves[rng.integers(len(outline.curves))]
    x, y = curve.points(np.array([rng.uniform() * curve.length]))[0]
    zone = Zone.around((float(x), float(y)), h / grading, 3.0 * h / grading, rng.uniform(0.08, 0.25))
    side = bool(rng.integers(2)) and len(outline.curves) > 1
    return Scene(
        outline=outline,
        center=center,
        length=length,
        spacing=Spacing(h, (zone,)),
        poisson=float(rng.choice([rng.uniform(0.0, 0.45), 0.499])),
        plane=str(rng.choice(["strain", "stress"])),
        clamped=outline.names[rng.integers(len(outline.names))] if side else None,
        jitter=float(rng.uniform(0.0, 0.4)),
        waves=int(rng.integers(2**31)),
    )


def jittered(scene: Scene, seed: int) -> Cloud:
    """The scene's cloud, inner nodes moved by up to ``jitter`` spacings, half-way to the boundary at most."""
    cloud = build_cloud(scene.outline, scene.spacing, seed)
    rng = np.random.default_rng(seed + 1)
    points = cloud.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), cloud.boundary_nodes)
    room = cKDTree(points[cloud.boundary_nodes]).query(points[inner])[0]
    reach = np.minimum(scene.jitter * cloud.spacing[inner], 0.5 * room) * np.sqrt(
        rng.uniform(size=len(inner))
    )
    angle = rng.uniform(0.0, 2.0 * math.pi, len(inner))
    points[inner] += reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Cloud(points, cloud.spacing, cloud.surfaces)


def bulk_error(scene: Scene, cloud: Cloud, degree: int) -> tuple[float, float]:
    """Relative displacement error and certificate."""
    material = isotropic(1.0, scene.poisson, scene.plane)
    held, nodes = {}, []
    if scene.clamped is not None:
        held = {scene.clamped: (True, True)}
    else:
        first = int(cloud.boundary_nodes[0])
        away = cloud.points - cloud.points[first]
        last = int(np.argmax((away**2).sum(axis=1)))
        across = int(abs(away[last, 0]) > abs(away[last, 1]))
        nodes = [(first, 0), (first, 1), (last, across)]
    model = BodyModel.build("body", cloud, material, MlsSettings(degree))
    body = assemble(model, held, nodes, "auto")
    rng = np.random.default_rng(scene.waves)
    measure = cloud.spacing[:, None]
    errors = []
    for _ in range(FIELDS):
        numbers = tuple((float(a), float(b)) for a, b in rng.uniform(-2.0, 2.0, (2, 2)))
        phases = tuple(float(a) for a in rng.uniform(0.0, 6.0, 2))
        wave = Wave(material.stiffness, numbers, phases, scene.center, scene.length)
        exact = wave.displacement(cloud.points)
        if nodes:
            exact = exact + rigid_motion(cloud.points, [(n, c, -exact[n, c]) for n, c in nodes])
        source = boundary_values(body, wave.displacement, wave.stress)
        source = with_body_force(body, source, wave.force)
        found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)[: len(cloud.points)]
        mean = (measure**2 * exact).sum(axis=0) / (measure**2).sum()
        errors.append(np.linalg.norm(measure * (found - exact)) / np.linalg.norm(measure * (exact - mean)))
    return float(np.sqrt(np.mean(np.square(errors)))), bulk_stability(body)


def rigid_motion(points: np.ndarray, wanted: list[tuple[int, int, float]]) -> np.ndarray:
    """The rigid motion (n, 2) with given displacements at three (node, component)s."""
    matrix = [[c == 0, c == 1, -points[n, 1] if c == 0 else points[n, 0]] for n, c, _ in wanted]
    x, y, turn = np.linalg.solve(np.array(matrix, dtype=float), [value for _, _, value in wanted])
    return np.asarray(np.array([x, y]) + turn * np.stack([-points[:, 1], points[:, 0]], axis=1))
