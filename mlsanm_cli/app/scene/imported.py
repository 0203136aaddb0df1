"""Cases with bodies from files. What reads and traces these is imported for cases that have such bodies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mlsanm_cli.case import LoadedCase, load_case
from mlsanm_cli.case.model.files import FileShape, Surveyed

if TYPE_CHECKING:
    from mlsanm_cli.app.scene.geometry_files import Foreign


def load_with_files(path: Path, overrides: tuple[str, ...] = ()) -> LoadedCase:
    """A validated case whose shapes may stand in files. Raises RunError and CaseError."""
    return load_case(path, overrides, inspect_geometry_file)


def foreign(shape: FileShape) -> Foreign:
    """The body in a shape's file. Raises GeometryError, whose message begins with the file's name."""
    from mlsanm_cli.app.scene.geometry_files import read_body

    return read_body(shape)


def inspect_geometry_file(shape: FileShape) -> Surveyed:
    """What the checks of a case want to know. Raises GeometryError."""
    from mlsanm_cli.app.scene.geometry_files import survey_of

    return survey_of(shape)
