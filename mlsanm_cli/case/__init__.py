"""The case file: TOML in, one frozen validated `Case` out, or every problem at once."""

from __future__ import annotations

from mlsanm_cli.case.base import split_boundary
from mlsanm_cli.case.loads import Displacement, Load, Platen, Pressure, Traction
from mlsanm_cli.case.model import (
    Adapt,
    Body,
    Case,
    Contact,
    Material,
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
    "AnyShape",
    "Body",
    "Case",
    "Contact",
    "Disk",
    "Displacement",
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
    "Traction",
    "case_hash",
    "load_case",
    "parse_case",
    "resolved_mapping",
    "split_boundary",
]
