"""One run of each small scene for all tests that only look at results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.scene import assemble as scene
from mlsanm_cli.io.plots import figures
from mlsanm_cli.system import THREAD_VARIABLES
from tests.app.scenes import BAR, PATCH, PUNCHES, SMOOTH, hertz, solve


@pytest.fixture(autouse=True)
def _same_environment() -> Iterator[None]:
    """The commands set the number of threads for their process, which here is pytest's."""
    before = {variable: os.environ.get(variable) for variable in THREAD_VARIABLES}
    yield
    for variable, value in before.items():
        if value is None:
            os.environ.pop(variable, None)
        else:
            os.environ[variable] = value


@pytest.fixture(autouse=True, scope="session")
def _coarse_pictures() -> Iterator[None]:
    """Dots and the layout are most of what a picture costs, and nothing here depends on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(figures._STYLE, "savefig.dpi", 50)
        patch.setitem(figures._STYLE, "figure.constrained_layout.use", False)
        yield


@pytest.fixture
def afterwards() -> Iterator[pytest.MonkeyPatch]:
    """Changes places, and what is done with condensed scenes, which are shared with other tests all the same
    (tests.conftest)."""
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture
def alone() -> None:
    """Contact grids do not begin with those of other tests (tests.conftest)."""


@pytest.fixture
def by_nodes() -> Iterator[None]:
    """No contact has a grid of its own, even off all corners."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene, "contact_ranges", lambda *given: {})
        yield


def _solved_once(name: str, text: str, *overrides: str) -> Any:
    """The directory of a run that all tests look at."""

    @pytest.fixture(scope="session", name=name)
    def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
        place = tmp_path_factory.mktemp("scenes") / name.removesuffix("_run")
        solve(text, place, *overrides)
        return place

    return directory


# Fields inside the path and at its end: exact law, and power series of the hyperbolic law.
hertz_run = _solved_once("hertz_run", hertz(), "output.at=[0.3, 0.7, 1.0]")
series_run = _solved_once("series_run", hertz(), "output.at=[0.3, 0.7, 1.0]", *SMOOTH)
# Exact law, uniform pressure; no contact and two stages; two contacts.
patch_run = _solved_once("patch_run", PATCH)
bar_run = _solved_once("bar_run", BAR)
punches_run = _solved_once("punches_run", PUNCHES)
