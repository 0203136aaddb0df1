"""A picture of a scene before it is solved: nodes, spacings, supports, loads, obstacles and contacts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mlsanm_cli.app.results.drawn import marks_of
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.cloud import CloudBody, plot_cloud
from mlsanm_cli.io.plots.figures import SUFFIXES
from mlsanm_cli.io.run_reader import BodyData


def draw_model(path: Path, case: Case, prepared: SceneModel) -> None:
    """Draws the bodies coloured by their spacing, with supports, loads, obstacles and contacts. Raises
    RunError for an unknown suffix, and if the file cannot be written."""
    if path.suffix.lower() not in SUFFIXES:
        raise RunError(f"{path}: picture formats are {', '.join(SUFFIXES)}", "the suffix selects the format")
    clouds = {name: model.cloud for name, model in prepared.models.items()}
    bodies = [
        CloudBody(cloud.points, np.zeros_like(cloud.points), cloud.spacing, cloud.triangles)
        for cloud in clouds.values()
    ]
    touching = {one.name: one.points[[int(one.gap.argmin())]] for one in prepared.pairings}
    stored = {name: BodyData(cloud.points, *cloud.boundary) for name, cloud in clouds.items()}
    marks = marks_of(case, stored, touching, {})
    nodes = sum(len(cloud.points) for cloud in clouds.values())
    title = f"{case.title}, {nodes} nodes" if case.title else f"{nodes} nodes"
    plot_cloud(
        path, bodies, case.units.label("spacing", "length"), title, marks=marks, unit=case.units.length
    )
