"""The nodes of one named boundary."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.memo import digest
from mlsanm_cli.values import dataclass


@dataclass(frozen=True)
class Surface:
    """The nodes of one named boundary, in order along its curve.

    ``index`` (b,) into the body's points, ``arc_length`` (b,), ``normal`` (b, 2) of this boundary alone: a
    corner node belongs to both boundaries that meet there, with each one's own normal. ``weight`` (b,) is the
    length of surface a node stands for (trapezoid rule).
    """

    name: str
    curve: Curve
    index: IntArray
    arc_length: FloatArray
    normal: FloatArray

    @cached_property
    def content(self) -> str:
        """A digest of the nodes; of the curve behind them they need to know no more."""
        return digest(
            *(self.name, self.index, self.arc_length, self.normal), self.curve.closed, self.curve.length
        )

    @cached_property
    def weight(self) -> FloatArray:
        """Quadrature weights along the surface."""
        s = self.arc_length
        if self.curve.closed:
            steps = np.diff(np.append(s, self.curve.length))
            both = steps + np.roll(steps, 1)
        else:
            steps = np.diff(s)
            both = np.append(steps, 0.0) + np.append(0.0, steps)
        return np.asarray(0.5 * both)
