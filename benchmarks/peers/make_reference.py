"""The over-refined profiles in reference/: scikit-fem on two meshes each, the second twice as fine.

    python benchmarks/peers/make_reference.py [hertz slip history]

Prints by how much the last halving of spacings and load steps changed the profile. Takes some minutes and
2 GB. Contact ends at 0.04994 in these bodies, not at Hertz's 0.05, and the meshes are graded to that.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from meshes import Grading, hertz_outlines, make, vertices
from scenes import REFERENCE, STICK, difference, read_profile

ENDS = (-0.04994, 0.04994)
KINKS = (ENDS[0], -STICK, STICK, ENDS[1])
FRICTION = [(Grading(5e-5, 1e-3, 0.17, 0.12, KINKS), 120), (Grading(2.5e-5, 5e-4, 0.13, 0.1, KINKS), 240)]
RUNS = {
    "hertz": [(Grading(1e-5, 8e-4, 0.12, 0.1, ENDS), 1), (Grading(5e-6, 4e-4, 0.1, 0.08, ENDS), 1)],
    "slip": FRICTION,
    "history": FRICTION,
}


def main(problems: list[str]) -> None:
    REFERENCE.mkdir(exist_ok=True)
    script = Path(__file__).parent / "skfem_peer.py"
    for problem in problems or list(RUNS):
        column = "pressure" if problem == "hertz" else "traction"
        with tempfile.TemporaryDirectory() as directory:
            mesh, outs = (
                Path(directory) / "mesh.npz",
                [Path(directory) / "coarse.csv", REFERENCE / f"{problem}.csv"],
            )
            for (grading, levels), out in zip(RUNS[problem], outs, strict=True):
                arrays = make(hertz_outlines(grading))
                np.savez(mesh, **arrays)
                arguments = [problem, str(mesh), str(out), "--levels", str(levels)]
                subprocess.run([sys.executable, str(script), *arguments], check=True)
            coarse, fine = (read_profile(out, column) for out in outs)
            if column == "traction":
                coarse, fine = coarse.even(), fine.even()
            change = difference(coarse, fine)
        print(
            f"{problem}: {vertices(arrays)} vertices; the last halving changed {100 * change:.3f} %",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
