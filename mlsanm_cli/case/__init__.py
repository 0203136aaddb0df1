"""The case file: TOML in, one frozen validated `Case` out, or every problem at once."""

from __future__ import annotations

from mlsanm_cli.case.base import split_boundary
from mlsanm_cli.case.expressions import ExpressionError, value_at
from mlsanm_cli.case.loads import (
    AnyLoad,
    BodyForce,
    Displacement,
    Load,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.case.materials import Material
from mlsanm_cli.case.model import (
    Adapt,
    Body,
    Case,
    Contact,
    Mls,
    Model,
    Output,
    Reference,
    Refine,
    Regularization,
    Solver,
    Support,
)
from mlsanm_cli.case.reading import LoadedCase, case_hash, load_case, parse_case, resolved_mapping
from mlsanm_cli.case.shapes import Annulus, AnyShape, Disk, HalfDisk, Polygon, Rectangle, Sector, Shape

__all__ = [
    "Adapt",
    "Annulus",
    "AnyLoad",
    "AnyShape",
    "Body",
    "BodyForce",
    "Case",
    "Contact",
    "Disk",
    "Displacement",
    "ExpressionError",
    "HalfDisk",
    "Load",
    "LoadedCase",
    "Material",
    "Mls",
    "Model",
    "Output",
    "Platen",
    "Polygon",
    "Pressure",
    "Rectangle",
    "Reference",
    "Refine",
    "Regularization",
    "Sector",
    "Shape",
    "Solver",
    "Support",
    "Temperature",
    "Traction",
    "case_hash",
    "load_case",
    "parse_case",
    "resolved_mapping",
    "split_boundary",
    "value_at",
]
