"""What is run: for every part mlsanm with its default clouds, by accuracy of the contact, and its peers."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from entries import HERE, Entry, Job
from programs import PEERS

CASES = HERE.parents[1] / "cases"


def mlsanm(label: str, case: str, *settings: str) -> Entry:
    """``mlsanm run`` without caches and pictures, with the exact laws."""

    def prepare(stem: Path) -> Job:
        given = ["output.vtu=false", 'contact.interface.regularization.law="exact"', *settings]
        command = [sys.executable, "-m", "mlsanm_cli", "run", str(CASES / f"{case}.toml"), "--quiet"]
        command += ["--force", "--threads", "1", "--out", str(stem)]
        command += [part for text in given for part in ("--set", text)]
        summary = stem / "summary.json"
        nodes = lambda: int(json.loads(summary.read_text())["nodes"])  # noqa: E731
        return Job({"geometry": command}, stem / "interface.csv", nodes)

    return Entry("mlsanm", label, "mlsanm", prepare)


def stages(*factors: str) -> str:
    """An override of a case's stages."""
    return f"stage=[{', '.join(factors)}]"


GRIDS = {
    "1e-2": ["contact.interface.accuracy=1e-2"],
    "3e-3": ["contact.interface.accuracy=3e-3"],
    "defaults (1e-3)": [],
}
"""Contact grids by the accuracy asked for; clouds as in cases/, which give no spacing."""
LEVELS = stages(*(f"{{press={k / 50}}}" for k in range(1, 51)))
END = "output.at=[4.0]"
SLIP = [stages("{press=1.0}", "{shear=1.0}"), "output.at=[2.0]"]

PARTS: dict[str, list[Entry]] = {
    "hertz": [*(mlsanm(label, "hertz", *grid) for label, grid in GRIDS.items()), *PEERS["hertz"]],
    "levels": [
        mlsanm("5e-2", "hertz", LEVELS, "contact.interface.accuracy=5e-2"),
        *(mlsanm(label, "hertz", LEVELS, *grid) for label, grid in GRIDS.items()),
        *PEERS["levels"],
    ],
    "slip": [
        *(mlsanm(label, "cattaneo_mindlin", *SLIP, *grid) for label, grid in GRIDS.items()),
        *PEERS["slip"],
    ],
    "history": [
        *(mlsanm(label, "cattaneo_mindlin", END, *grid) for label, grid in GRIDS.items()),
        *PEERS["history"],
    ],
    "patch": [mlsanm("cases/patch.toml", "patch"), *PEERS["patch"]],
}
