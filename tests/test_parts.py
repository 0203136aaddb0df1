"""Parts of scipy that are loaded alone are those of scipy, whichever comes first."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SAME = (
    "import pickle, numpy as np, scipy.optimize, scipy.spatial, scipy.sparse.csgraph\n"
    "from mlsanm_cli.parts import Delaunay, brentq, cKDTree, dijkstra\n"
    "assert brentq is scipy.optimize.brentq\n"
    "assert scipy.optimize.minimize_scalar(lambda x: (x - 1.0) ** 2).success\n"
    "assert (Delaunay, cKDTree) == (scipy.spatial.Delaunay, scipy.spatial.cKDTree)\n"
    "assert dijkstra is scipy.sparse.csgraph.dijkstra\n"
    "assert issubclass(scipy.spatial.KDTree, cKDTree)\n"
    "tree = pickle.loads(pickle.dumps(cKDTree(np.arange(8.0).reshape(4, 2))))\n"
    "print(tree.query([2.0, 3.1])[1], scipy.spatial.distance.euclidean([0.0], [2.0]))\n"
)
THREADED = "import threading; threading.Thread(target=threading.Event().wait, daemon=True).start()\n"
PARTS = "from mlsanm_cli.parts import Delaunay, brentq, cKDTree, dijkstra\n"
LOADED = (
    f"import sys; {PARTS}"
    "whole = {'scipy.optimize', 'scipy.spatial', 'scipy.sparse.csgraph', 'scipy.special'}\n"
    "print(sorted(whole & set(sys.modules)))\n"
)


def python(code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


@pytest.mark.parametrize(
    "first", [PARTS, "", THREADED + PARTS], ids=["parts first", "scipy first", "beside a thread"]
)
def test_they_are_scipys_own(first: str) -> None:
    assert python(first + SAME) == "1 2.0\n"


def test_they_come_without_their_packages() -> None:
    assert python(LOADED) == "[]\n"


def test_beside_other_threads_packages_are_loaded_as_scipy_means_them() -> None:
    assert "scipy.spatial" in python(THREADED + LOADED)
