"""Modules that wait until they are used, and parts of scipy that are loaded alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.processes import ROOT, printed

START = (
    "import sys, types\n"
    "from mlsanm_cli import startup\n"
    "startup.DEFERRED = frozenset({'big', 'big.more', 'broken'})\n"
    "with startup.lean_imports():\n"
    "    import big\n"
)
PACKAGE = {
    "big/__init__.py": "print('big')\nfrom big._part import one\nfrom . import more\ntwo = 2\n",
    "big/_part.py": "print('part')\nfrom . import _other\none = 1\n",
    "big/_other.py": "print('other')\n",
    "big/more.py": "print('more')\nimport time\ntime.sleep(0.1)\nthree = 3\n",
    "broken.py": "print('broken')\nif not __import__('os').path.exists('mended'): raise OSError\nfour = 4\n",
}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a package."""
    for name, text in PACKAGE.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def words_of(place: Path, code: str) -> list[str]:
    """Words that code prints in a folder."""
    return printed("-c", code, cwd=place, PYTHONPATH=f"{place}{os.pathsep}{ROOT}").split()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("", ""),
        ("big.__path__, big.__spec__, big.__name__", ""),
        ("from big._part import one; print(one)", "part other 1"),
        ("print(big._part.one); print(big.two)", "part other 1 big 2"),
        ("from big import two; print(two, big.one)", "big part other 2 1"),
        ("from big import *; print(one, two)", "big part other 1 2"),
        ("import big.more; print(big.more.three)", "more 3"),
        ("print(big.two, big.more.three)", "big part other more 2 3"),
        ("print(hasattr(big, 'five'), hasattr(big, '_five'))", "big part other False False"),
        (
            "big.two; print(type(big) is types.ModuleType, sys.modules['big'] is big)",
            "big part other True True",
        ),
    ],
)
def test_code_runs_when_a_name_is_asked_for(place: Path, code: str, words: str) -> None:
    assert words_of(place, START + code) == words.split()


def test_threads_wait_for_the_one_that_loads(place: Path) -> None:
    code = (
        "import big.more, concurrent.futures as futures\n"
        "with futures.ThreadPoolExecutor(4) as pool:\n"
        "    print(*pool.map(lambda _: big.more.three, range(4)))\n"
    )
    assert words_of(place, START + code) == ["more", *"3333"]


def test_what_failed_is_tried_again(place: Path) -> None:
    code = (
        "import broken, pathlib\n"
        "try:\n    broken.four\nexcept OSError:\n    pathlib.Path('mended').touch()\n"
        "print(broken.four)\n"
    )
    assert words_of(place, START + code) == ["broken", "broken", "4"]


def test_where_numpy_is_there_nothing_waits(place: Path) -> None:
    code = START.replace("import sys", "import numpy, sys") + "print(type(big) is types.ModuleType)"
    assert words_of(place, code) == ["big", "part", "other", "more", "True"]


PARTS = (
    "from scipy.linalg.lapack import dgecon, dgeqp3, dgetrf, dgetrs, dgtsv, dpotrf, dpotrs\n"
    "from scipy.sparse.csgraph import connected_components\n"
    "from scipy.spatial import Delaunay, cKDTree\n"
)
LEAN = "from mlsanm_cli.startup import lean_imports\nwith lean_imports():\n    pass\n"
WHOLE = (
    "import scipy.linalg, scipy.optimize, scipy.spatial, scipy.sparse.csgraph\n"
    "assert scipy.linalg.solve([[2.0]], [4.0]) == 2.0\n"
)
BLAS = "import scipy.linalg.cython_blas, scipy.linalg.cython_lapack\n"
SAME = (
    "import pickle, numpy as np\n"
    "assert scipy.optimize.minimize_scalar(lambda x: (x - 1.0) ** 2).success\n"
    "assert (Delaunay, cKDTree) == (scipy.spatial.Delaunay, scipy.spatial.cKDTree)\n"
    "assert connected_components is scipy.sparse.csgraph.connected_components\n"
    "for routine in (dgecon, dgeqp3, dgetrf, dgetrs, dgtsv, dpotrf, dpotrs):\n"
    "    assert routine in vars(scipy.linalg.lapack).values()\n"
    "assert scipy.linalg.cython_blas.__pyx_capi__ and scipy.linalg.cython_lapack.__pyx_capi__\n"
    "assert scipy.linalg.eigvalsh([[3.0]]) == 3.0 and scipy.linalg.qr([[1.0]], pivoting=True)[2] == 0\n"
    "assert issubclass(scipy.spatial.KDTree, cKDTree)\n"
    "assert np.ma.masked_array([1.0, 2.0], [True, False]).sum() == 2.0\n"
    "assert np.ma.isMaskedArray(np.ma.masked_array([1.0], [True]))\n"
    "assert np.polynomial.Polynomial([1.0, 1.0])(2.0) == 3.0\n"
    "tree = pickle.loads(pickle.dumps(cKDTree(np.arange(8.0).reshape(4, 2))))\n"
    "print(tree.query([2.0, 3.1])[1], scipy.spatial.distance.euclidean([0.0], [2.0]))\n"
)
ORDERS = {"lean, parts first": LEAN + PARTS + BLAS + WHOLE, "parts first": PARTS + BLAS + WHOLE}


@pytest.mark.parametrize("order", ORDERS)
def test_they_are_scipys_own(order: str) -> None:
    assert printed("-c", ORDERS[order] + SAME) == "1 2.0\n"
