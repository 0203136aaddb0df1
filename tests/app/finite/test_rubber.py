"""Bodies of rubber against closed formulas, up to nearly incompressible ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.results.probe import probe_point
from mlsanm_cli.continuation.roots import root
from tests.app.scenes import solve
from tests.case_text import body, box, contact, head, item, load, material, plane, support

C10, C01, INNER, OUTER = 0.4, 0.1, 1.0, 2.0
MOONEY = {"law": "mooney-rivlin", "c10": C10, "c01": C01}


def tube(poisson: float, spacing: float, pressure: float) -> str:
    """A quarter of a tube under a pressure inside that follows."""
    shape = {"kind": "sector", "center": [0.0, 0.0], "radii": [INNER, OUTER], "angles": [0.0, 90.0]}
    return (
        head("strain", strain="finite")
        + material("rubber", nu=poisson, **MOONEY)
        + body("tube", "rubber", spacing, shape)
        + support("tube.start", uy=0.0)
        + support("tube.end", ux=0.0)
        + load("inside", "tube.inner", "pressure", pressure=pressure, follows=True)
        + item("probe", name="in", body="tube", point=[INNER, 0.0])
        + item("probe", name="out", body="tube", point=[OUTER, 0.0])
    )


def inflated(radius: float) -> tuple[float, float]:
    """Pressure that inflates the inner radius of an incompressible tube to ``radius``, and hoop stress there.

    With r^2 = R^2 + radius^2 - INNER^2 and the stretch r/R around, the stresses of Mooney's and Rivlin's law
    differ by 2 (c10 + c01) (r^2/R^2 - R^2/r^2), and d sigma_rr / dr is that over r (Rivlin 1949,
    doi:10.1098/rsta.1949.0009)."""
    points, weights = np.polynomial.legendre.leggauss(40)
    start, end = radius, np.sqrt(OUTER**2 + radius**2 - INNER**2)
    r = 0.5 * (start + end) + 0.5 * (end - start) * points
    square = r**2 / (r**2 - radius**2 + INNER**2)
    difference = 2.0 * (C10 + C01) * (square - 1.0 / square)
    pressure = float(0.5 * (end - start) * weights @ (difference / r))
    stretch = (radius / INNER) ** 2
    return pressure, 2.0 * (C10 + C01) * (stretch - 1.0 / stretch) - pressure


@pytest.mark.parametrize(("poisson", "method"), [(0.4999, "anm"), (0.4999, "newton")])
def test_an_inflated_tube_of_mooney_and_rivlin(poisson: float, method: str, tmp_path: Path) -> None:
    pressure, hoop = inflated(1.5)
    text = tube(poisson, 0.1, pressure) + f'[solver]\nmethod = "{method}"\n'
    summary = solve(text, tmp_path / "run")
    moved = summary["probes"]["in"]["displacement"][0], summary["probes"]["out"]["displacement"][0]
    np.testing.assert_allclose(moved, [0.5, np.sqrt(OUTER**2 + 1.25) - OUTER], rtol=2e-3)
    # Compressibility changes stresses by 1e-3.
    np.testing.assert_allclose(summary["probes"]["in"]["stress"][:2], [-pressure, hoop], atol=6e-3 * hoop)
    assert summary["error_estimate"]["displacement"] < 5e-3
    (seen,) = probe_point(tmp_path / "run", [1.0], "tube", (INNER, 0.0))
    np.testing.assert_allclose(seen["von_mises"], summary["probes"]["in"]["von_mises"], rtol=1e-6)


def test_a_nearly_incompressible_block_is_squeezed_by_a_plate(tmp_path: Path) -> None:
    """Neo-Hooke in plane strain, free sideways: mu (l - 1/l) + lam ln(l s) / l = 0 at the height s."""
    poisson, height, modulus = 0.4999, 0.7, 2.6
    lam, mu = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 * modulus / (1.0 + poisson)
    text = (
        head("strain", strain="finite")
        + material("rubber", E=modulus, nu=poisson, law="neo-hookean")
        + body("block", "rubber", 0.2, box([0.0, 1.0], [0.0, 1.0]))
        + support("block.bottom", uy=0.0)
        + support("block.left", ux=0.0)
        + item("load", name="press", kind="obstacle", obstacle="lid", uy=height - 1.0)
        + contact("lid", "block.top", obstacle=plane([0.0, 1.0], [0.0, -1.0]))
    )
    width = root(lambda x: mu * (x - 1.0 / x) + lam * np.log(x * height) / x, 1.0, 2.0)
    force = mu * (height - 1.0 / height) + lam * np.log(width * height) / height
    summary = solve(text, tmp_path / "run")
    np.testing.assert_allclose(summary["contacts"]["lid"]["force"], [0.0, force], rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(summary["contacts"]["lid"]["peak_pressure"], -force / width, rtol=1e-5)
