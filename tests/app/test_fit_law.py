"""Constants of laws of rubber from tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from mlsanm_cli.app.fit_law import TESTS, fit, read_tests, stress_in
from mlsanm_cli.cli.commands import cli
from mlsanm_cli.errors import RunError
from mlsanm_cli.mechanics.laws.law import law_class

KNOWN: dict[str, dict[str, Any]] = {
    "neo-hookean": {"E": 2.7},
    "mooney-rivlin": {"c10": 0.35, "c01": 0.08},
    "yeoh": {"c10": 0.4, "c20": -0.01, "c30": 0.002},
    "arruda-boyce": {"mu": 0.7, "locking_stretch": 3.0},
    "ogden": {"shear_moduli": [0.63, 0.0012, -0.01], "exponents": [1.3, 5.0, -2.0]},
}


@pytest.mark.parametrize("name", KNOWN)
def test_the_constants_of_exact_data_are_found(name: str) -> None:
    stretch = np.linspace(0.7, 3.0, 12)
    exact = law_class(name)(plane="strain", nu=0.499, **KNOWN[name])
    tests = {test: np.stack([stretch, stress_in(exact, test, stretch)]) for test in TESTS}
    found = fit(tests, name)
    assert found.error < 2e-5
    assert not found.falling
    if name != "ogden":  # whose constants are not unique to this accuracy
        np.testing.assert_allclose(list(found.constants.values())[:-1], list(KNOWN[name].values()), rtol=1e-3)


@pytest.mark.parametrize("stretch", [0.6, 1.7])
def test_stresses_are_those_of_formulas(stretch: float) -> None:
    """Mooney and Rivlin: 2 (l - l^-2) (c10 + c01 / l) and its counterparts."""
    law, at = law_class("mooney-rivlin")(plane="strain", nu=0.4, c10=0.3, c01=0.1), np.array([stretch])
    exact = {
        "uniaxial": 2.0 * (stretch - stretch**-2) * (0.3 + 0.1 / stretch),
        "equibiaxial": 2.0 * (stretch - stretch**-5) * (0.3 + 0.1 * stretch**2),
        "planar": 2.0 * (stretch - stretch**-3) * 0.4,
    }
    for test, stress in exact.items():
        np.testing.assert_allclose(stress_in(law, test, at), stress, rtol=1e-12)


def test_the_command_prints_a_material_and_draws(tmp_path: Path) -> None:
    data, image = tmp_path / "tests.csv", tmp_path / "fit.png"
    rows = [f"uniaxial,{1 + 0.2 * i},{2.0 * (1 + 0.2 * i - (1 + 0.2 * i) ** -2)}" for i in range(1, 8)]
    data.write_text("\n".join(["test,stretch,stress", *rows]))
    arguments = ["fit-law", str(data), "--law", "neo-hookean", "--law", "mooney-rivlin"]
    result = CliRunner().invoke(cli, [*arguments, "--json", "--picture", str(image)])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    np.testing.assert_allclose(found["laws"]["neo-hookean"]["constants"]["E"], 5.996, rtol=1e-5)
    assert image.stat().st_size > 1000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stretch,stress\n1.5,0.2\n", "columns test, stretch, stress"),
        ("test,stretch,stress\nshear,1.5,0.2\n", ':2: there is no test "shear"'),
        ("test,stretch,stress\nplanar,1.5,0.2\nplanar,a,0.2\n", ":3: stretch and stress must be numbers"),
        ("test,stretch,stress\nplanar,-1,0.2\n", ":2: stretches must be positive"),
        ("test,stretch,stress\nplanar,1.5,-0.2\n", "sign"),
        ("test,stretch,stress\n", "no data"),
    ],
)
def test_faults_of_data_are_located(text: str, words: str, tmp_path: Path) -> None:
    data = tmp_path / "tests.csv"
    data.write_text(text)
    with pytest.raises(RunError, match=words):
        read_tests(data)
