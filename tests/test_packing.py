"""What a run keeps of itself comes back as it was, or is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.packing import packed, unpacked
from mlsanm_cli.solve.checkpoint import Start


@dataclass(frozen=True, eq=False)
class Mark:
    """A method's mark."""

    lam: float
    x: FloatArray


@dataclass(frozen=True, eq=False)
class Older:
    """The same mark of another version, which knew more."""

    lam: float
    x: FloatArray
    pace: float


def test_what_was_packed_comes_back() -> None:
    mark = Mark(0.1, np.array([-0.0, np.nan, np.inf, 1.0 / 3.0])[::2])
    back = unpacked(Mark, packed(mark))
    assert packed(back) == packed(mark)
    assert back.x.tobytes() == mark.x.tobytes()


OF_THIS, OF_ANOTHER = Mark(0.5, np.ones(3)), Older(0.5, np.ones(3), 1.0)


@pytest.mark.parametrize(("kept", "other"), [(OF_THIS, Older), (OF_ANOTHER, Mark)])
def test_a_mark_of_another_version_is_refused(kept: object, other: type[object]) -> None:
    start = Start(3, packed(kept))
    assert start.mark(type(kept)) is not None
    with pytest.raises(RunError, match="checkpoint of the run cannot be read"):
        start.mark(other)
