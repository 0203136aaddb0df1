"""Parts of scipy that are loaded alone are those of scipy, whichever comes first."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAMES = "Delaunay, brentq, cKDTree, connected_components, dgecon, dgeqp3, dgetrf, dgetrs, dpotrf, dpotrs"
PARTS = f"from mlsanm_cli.parts import {NAMES}\n"
LEAN = "from mlsanm_cli.lean import lean_imports\nwith lean_imports():\n    import mlsanm_cli.parts\n"
WHOLE = (
    "import scipy.linalg, scipy.optimize, scipy.spatial, scipy.sparse.csgraph\n"
    "assert scipy.linalg.solve([[2.0]], [4.0]) == 2.0\n"
)
BLAS = "import scipy.linalg.cython_blas, scipy.linalg.cython_lapack\n"
SAME = (
    "import pickle, numpy as np\n"
    "assert brentq is scipy.optimize.brentq\n"
    "assert scipy.optimize.minimize_scalar(lambda x: (x - 1.0) ** 2).success\n"
    "assert (Delaunay, cKDTree) == (scipy.spatial.Delaunay, scipy.spatial.cKDTree)\n"
    "assert connected_components is scipy.sparse.csgraph.connected_components\n"
    "for routine in (dgecon, dgeqp3, dgetrf, dgetrs, dpotrf, dpotrs):\n"
    "    assert routine in vars(scipy.linalg.lapack).values()\n"
    "assert scipy.linalg.cython_blas.__pyx_capi__ and scipy.linalg.cython_lapack.__pyx_capi__\n"
    "assert scipy.linalg.eigvalsh([[3.0]]) == 3.0 and scipy.linalg.qr([[1.0]], pivoting=True)[2] == 0\n"
    "assert issubclass(scipy.spatial.KDTree, cKDTree)\n"
    "assert np.ma.masked_array([1.0, 2.0], [True, False]).sum() == 2.0\n"
    "assert np.polynomial.Polynomial([1.0, 1.0])(2.0) == 3.0\n"
    "tree = pickle.loads(pickle.dumps(cKDTree(np.arange(8.0).reshape(4, 2))))\n"
    "print(tree.query([2.0, 3.1])[1], scipy.spatial.distance.euclidean([0.0], [2.0]))\n"
)
ORDERS = {
    "lean, parts first": LEAN + PARTS + BLAS + WHOLE,
    "lean, BLAS first": LEAN + BLAS + PARTS + WHOLE,
    "lean, scipy first": LEAN + WHOLE + BLAS + PARTS,
    "parts first": PARTS + BLAS + WHOLE,
    "scipy first": WHOLE + BLAS + PARTS,
}


def python(code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("order", ORDERS)
def test_they_are_scipys_own(order: str) -> None:
    assert python(ORDERS[order] + SAME) == "1 2.0\n"


@pytest.mark.parametrize(("names", "whole"), [(NAMES.replace(" brentq,", ""), []), ("brentq", ["linalg"])])
def test_they_come_without_their_packages(names: str, whole: list[str]) -> None:
    loaded = (
        "import sys, types\n"
        "packages = ('linalg', 'optimize', 'spatial', 'sparse.csgraph', 'special')\n"
        "print([name for name in packages if type(sys.modules.get(f'scipy.{name}')) is types.ModuleType])\n"
    )
    assert python(LEAN + PARTS.replace(NAMES, names) + loaded) == f"{whole}\n"
