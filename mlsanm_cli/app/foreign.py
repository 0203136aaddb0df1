"""Cases with bodies from files. What reads and traces these is imported for cases that have such bodies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mlsanm_cli.case import LoadedCase, load_case
from mlsanm_cli.case.files import FileShape, Surveyed

if TYPE_CHECKING:
    from mlsanm_cli.app.file_bodies import Foreign


def load_with_files(path: Path, overrides: tuple[str, ...] = ()) -> LoadedCase:
    """A validated case whose shapes may stand in files. Raises RunError and CaseError."""
    return load_case(path, overrides, survey)


def foreign(shape: FileShape) -> Foreign:
    """The body in a shape's file. Raises GeometryError, whose message begins with the file's name."""
    from mlsanm_cli.app.file_bodies import read_body

    return read_body(shape)


def survey(shape: FileShape) -> Surveyed:
    """What the checks of a case want to know. Raises GeometryError."""
    from mlsanm_cli.app.file_bodies import survey_of

    return survey_of(shape)
