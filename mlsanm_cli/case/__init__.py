"""The case file: a TOML text is turned into a frozen, validated `Case`, or into a list of all problems."""

from __future__ import annotations

from mlsanm_cli.case.model.bodies import Body
from mlsanm_cli.case.model.case import Case, finer_nodes
from mlsanm_cli.case.model.contacts import Contact
from mlsanm_cli.case.model.expressions import ExpressionError, value_at
from mlsanm_cli.case.model.fields import split_boundary
from mlsanm_cli.case.model.loads import (
    BodyForce,
    Displacement,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.motions import AnyLoad, ObstacleMotion, Platen
from mlsanm_cli.case.model.obstacles import AnyObstacle, DiskObstacle, PlaneObstacle
from mlsanm_cli.case.model.places import Place
from mlsanm_cli.case.model.section import Geometry, GeometryInspector
from mlsanm_cli.case.model.shapes import AnyShape, HalfDisk, Mesh, OutlineShape, Points
from mlsanm_cli.case.model.solver import Solver
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.reading.read import (
    LoadedCase,
    case_hash,
    load_case,
    parse_case,
    resolved_mapping,
    stored_case,
)

__all__ = [
    "AnyLoad",
    "AnyObstacle",
    "AnyShape",
    "Body",
    "BodyForce",
    "Case",
    "Contact",
    "DiskObstacle",
    "Displacement",
    "ExpressionError",
    "Geometry",
    "GeometryInspector",
    "HalfDisk",
    "LoadedCase",
    "Material",
    "Mesh",
    "ObstacleMotion",
    "OutlineShape",
    "Place",
    "PlaneObstacle",
    "Platen",
    "Points",
    "Pressure",
    "Solver",
    "Stop",
    "Temperature",
    "Traction",
    "case_hash",
    "finer_nodes",
    "load_case",
    "parse_case",
    "resolved_mapping",
    "split_boundary",
    "stored_case",
    "value_at",
]
