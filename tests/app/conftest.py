"""One run of each small scene for all tests that only look at results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from mlsanm_cli.app.scene import assemble as scene
from mlsanm_cli.io.plots import figures
from mlsanm_cli.system import THREAD_VARIABLES
from tests.app.scenes import AS_SERIES, BAR, PATCH, PUNCHES, hertz, solve


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
def by_nodes() -> Iterator[None]:
    """No contact has a grid of its own, even off all corners."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene, "contact_ranges", lambda *given: {})
        yield


@pytest.fixture(scope="session")
def hertz_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Hyperbolic law as it is, fields inside the path and at its end."""
    directory = tmp_path_factory.mktemp("scenes") / "hertz"
    solve(hertz(), directory, "output.at=[0.3, 0.7, 1.0]", *AS_SERIES)
    return directory


@pytest.fixture(scope="session")
def patch_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Exact law, uniform pressure."""
    directory = tmp_path_factory.mktemp("scenes") / "patch"
    solve(PATCH, directory)
    return directory


@pytest.fixture(scope="session")
def bar_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """No contact, two stages."""
    directory = tmp_path_factory.mktemp("scenes") / "bar"
    solve(BAR, directory)
    return directory


@pytest.fixture(scope="session")
def punches_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two contacts."""
    directory = tmp_path_factory.mktemp("scenes") / "punches"
    solve(PUNCHES, directory)
    return directory
