"""The case file: a TOML text is turned into a frozen, validated `Case`, or into a list of all problems."""

from __future__ import annotations

from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.case import (
    Body,
    Case,
    Contact,
    Model,
    Output,
    Probe,
    Reference,
    Refine,
    Regularization,
    Support,
)
from mlsanm_cli.case.model.expressions import ExpressionError, value_at
from mlsanm_cli.case.model.files import FileShape, Geometry, GeometryInspector, Mesh, Points
from mlsanm_cli.case.model.loads import (
    AnyLoad,
    BodyForce,
    Displacement,
    Load,
    ObstacleMotion,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import (
    AnyObstacle,
    DiskObstacle,
    Obstacle,
    PlaneObstacle,
    PolylineObstacle,
)
from mlsanm_cli.case.model.places import Place, label_of
from mlsanm_cli.case.model.shapes import (
    Annulus,
    AnyShape,
    Disk,
    DrawnShape,
    HalfDisk,
    OutlineShape,
    Polygon,
    Rectangle,
    Sector,
    Shape,
)
from mlsanm_cli.case.model.solver import Adapt, Mls, Solver
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.model.units import Units
from mlsanm_cli.case.reading.read import (
    LoadedCase,
    case_hash,
    load_case,
    parse_case,
    resolved_mapping,
    stored_case,
)

__all__ = [
    "Adapt",
    "Annulus",
    "AnyLoad",
    "AnyObstacle",
    "AnyShape",
    "Body",
    "BodyForce",
    "Case",
    "Contact",
    "Disk",
    "DiskObstacle",
    "Displacement",
    "DrawnShape",
    "ExpressionError",
    "FileShape",
    "Geometry",
    "GeometryInspector",
    "HalfDisk",
    "Load",
    "LoadedCase",
    "Material",
    "Mesh",
    "Mls",
    "Model",
    "Obstacle",
    "ObstacleMotion",
    "OutlineShape",
    "Output",
    "Place",
    "PlaneObstacle",
    "Platen",
    "Points",
    "Polygon",
    "PolylineObstacle",
    "Pressure",
    "Probe",
    "Rectangle",
    "Reference",
    "Refine",
    "Regularization",
    "Sector",
    "Shape",
    "Solver",
    "Stop",
    "Support",
    "Temperature",
    "Traction",
    "Units",
    "case_hash",
    "label_of",
    "load_case",
    "parse_case",
    "resolved_mapping",
    "split_boundary",
    "stored_case",
    "value_at",
]
