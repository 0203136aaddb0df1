"""What the comparison with other programs judges by: its measure of error and its stored references."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.peers.report import END, START, insert, tables
from benchmarks.peers.scenes import (
    FORCE,
    FRICTION,
    HALF_WIDTH,
    REFERENCE,
    SHEAR,
    Profile,
    difference,
    path,
    read_profile,
)


def resultant(profile: Profile) -> float:
    """Integral over the arc: dx to ds is 1/sqrt(1 - x^2) for radius 1."""
    return float(np.trapezoid(profile.values / np.sqrt(1.0 - profile.x**2), profile.x))


def test_difference_is_exact_for_lines_that_meet_between_nodes() -> None:
    hat = Profile(np.array([-1.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
    shifted = Profile(np.array([-1.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]))
    x = np.linspace(-1.0, 1.0, 400_001)
    expected = np.sqrt(np.sum((shifted.at(x) - hat.at(x)) ** 2) / np.sum(hat.at(x) ** 2))
    assert difference(shifted, hat) == pytest.approx(expected, rel=1e-6)
    assert difference(hat, hat) == 0.0


def test_even_part_drops_what_is_odd() -> None:
    x = np.array([-1.0, -0.3, 0.0, 0.5, 1.0])
    even = Profile(x, 2.0 + x).even()
    np.testing.assert_allclose(even.values, 2.0, rtol=1e-14)


def test_histories_end_where_the_case_does() -> None:
    assert path("hertz", 1) == [(0.0, FORCE)]
    history = path("history", 60)
    assert len(history) == 60
    assert history[14] == pytest.approx((0.0, FORCE))
    assert history[29] == pytest.approx((-SHEAR, FORCE))
    assert history[59] == pytest.approx((SHEAR, FORCE))


def test_references_carry_their_loads_within_the_cone() -> None:
    assert resultant(read_profile(REFERENCE / "hertz.csv", "pressure")) == pytest.approx(FORCE, rel=2e-4)
    for name, shear in (("slip", -SHEAR), ("history", SHEAR)):
        pressure = read_profile(REFERENCE / f"{name}.csv", "pressure")
        traction = read_profile(REFERENCE / f"{name}.csv", "traction")
        assert resultant(pressure) == pytest.approx(FORCE, rel=2e-4)
        assert resultant(traction) == pytest.approx(shear, rel=2e-4)
        assert np.all(np.abs(traction.values) <= FRICTION * pressure.values + 1e-6 * FORCE / HALF_WIDTH)


def timed(program: str, error: float, **seconds: float) -> dict[str, object]:
    """A point as run.py writes it, of 5 turns; 1 turn where it took more than 10 s."""
    times = {
        way: {"cpu_seconds": time, "spread": [time, time], "turns": 5 if time < 10.0 else 1}
        for way, time in seconds.items()
    }
    return {"program": program, "label": "mesh", "nodes": 7, "error": error, **times}


def test_tables_compare_the_fastest_that_are_good_enough() -> None:
    points = [
        timed("mlsanm", 0.009, geometry=0.6),
        timed("mlsanm", 0.002, geometry=0.9),
        timed("scikit-fem, graded", 0.008, given=0.3, geometry=0.4),
        timed("scikit-fem, even", 0.001, given=0.45, geometry=0.5),
        timed("CalculiX", 0.009, given=12.0, geometry=13.0),
        {"program": "GetFEM, Newton", "label": "mesh", "failed": True},
    ]
    lines = tables({"hertz": points}).splitlines()
    graded, even = "scikit-fem, graded, mesh", "scikit-fem, even, mesh"
    assert f"| Hertz | 1 % | 0.60 (mesh) | 0.30 ({graded}) | 0.40 ({graded}) | 2.00 | 1.50 |" in lines
    assert f"| Hertz | 0.3 % | 0.90 (mesh) | 0.45 ({even}) | 0.50 ({even}) | 2.00 | 1.80 |" in lines
    assert f"| Hertz | 0.1 % | none | 0.45 ({even}) | 0.50 ({even}) | - | - |" in lines
    assert any(line.startswith("| Hertz, peers on even meshes | 1 % | 0.60 (mesh) | 0.45") for line in lines)
    assert "| Hertz | mlsanm | mesh | 7 | - | 0.60 | 0.9 % |" in lines
    assert "| Hertz | CalculiX | mesh | 7 | 12.00 (1) | 13.00 (1) | 0.9 % |" in lines
    assert "| Hertz | GetFEM, Newton | mesh |  | failed | failed |  |" in lines


def test_tables_stand_between_their_marks() -> None:
    page = f"before\n{START}\nold\n{END}\nafter\n"
    once = insert(page, "new")
    assert once == f"before\n{START}\n\nnew\n\n{END}\nafter\n"
    assert insert(once, "new") == once
    with pytest.raises(ValueError, match="lacks"):
        insert("a page without marks", "new")


def test_the_page_has_the_marks() -> None:
    page = (REFERENCE.parents[2] / "docs" / "peers.md").read_text()
    assert START in page
    assert END in page
