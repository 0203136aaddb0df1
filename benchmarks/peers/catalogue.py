"""What is run: for every part mlsanm on the clouds that were found cheapest, and its peers."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from entries import HERE, Entry, Job
from meshes import KINKS
from programs import PEERS
from scenes import HALF_WIDTH, RADIUS, STICK

CASES = HERE.parents[1] / "cases"


def mlsanm(label: str, case: str, *settings: str) -> Entry:
    """``mlsanm run`` without caches and pictures, with the exact laws."""

    def prepare(stem: Path) -> Job:
        given = ["output.vtu=false", 'contact.interface.regularization.law="exact"', *settings]
        command = [sys.executable, "-m", "mlsanm_cli.cli", "run", str(CASES / f"{case}.toml"), "--quiet"]
        command += ["--no-cache", "--force", "--threads", "1", "--out", str(stem)]
        command += [part for text in given for part in ("--set", text)]
        summary = stem / "summary.json"
        nodes = lambda: int(json.loads(summary.read_text())["nodes"])  # noqa: E731
        return Job({"geometry": command}, stem / "interface.csv", nodes)

    return Entry("mlsanm", label, "mlsanm", prepare)


def cloud(
    coarse: float,
    zone: tuple[float, float, float],
    edge: tuple[float, float, float],
    points: tuple[float, ...] = (HALF_WIDTH,),
    beside: tuple[tuple[float, float, float], ...] = (),
    stick: tuple[tuple[float, float, float], ...] = (),
) -> list[str]:
    """Settings of both bodies: spacing far away; spacing, radius, growth of the zone, of ``edge`` and
    what lies ``beside`` it at +-points, and of what lies where sticking ends."""

    def refinements(body: str) -> str:
        places = [
            (0.0, *zone),
            *((sign * at, *one) for one in (edge, *beside) for at in points for sign in (-1, 1)),
            *((sign * STICK, *one) for one in stick for sign in (-1, 1)),
        ]
        # On the arc, not beside it: a fine radius may be smaller than the arc's height there.
        height = {"cylinder": lambda x: RADIUS - (RADIUS**2 - x**2) ** 0.5, "block": lambda _x: 0.0}[body]
        return ", ".join(
            f"{{at=[{x:.6g}, {height(x):.6g}], spacing={spacing}, radius={radius}, growth={growth}}}"
            for x, spacing, radius, growth in places
        )

    bodies = ("cylinder", "block")
    refine = [f"body.{body}.refine=[{refinements(body)}]" for body in bodies]
    return [*refine, *(f"body.{body}.spacing={coarse}" for body in bodies)]


def hertz_cloud(
    degree: int,
    neighbors: int,
    coarse: float,
    zone: tuple[float, float, float],
    edge: tuple[float, float, float],
    *beside: tuple[float, float, float],
) -> list[str]:
    """Settings of a cloud and of the local polynomials on it."""
    return [*cloud(coarse, zone, edge, beside=beside), f"mls.degree={degree}", f"mls.neighbors={neighbors}"]


def stages(*factors: str) -> str:
    """An override of a case's stages."""
    return f"stage=[{', '.join(factors)}]"


def graded_slip(
    neighbors: int,
    coarse: float,
    under: tuple[float, float, float],
    edge: tuple[float, float, float],
    stick: tuple[float, float, float],
) -> list[str]:
    """A cloud whose spacing ``under`` the contact is finer where it and its stick zone end."""
    return [*cloud(coarse, under, edge, stick=(stick,)), f"mls.neighbors={neighbors}"]


FINE_EDGE = (0.00015, 0.0015, 0.12)
CLOUDS = {
    "1.6k": hertz_cloud(2, 20, 0.29, (0.0087, 0.061, 0.26), (0.00093, 0.0025, 0.18)),
    "degree 4, 1.7k": hertz_cloud(
        4, 37, 0.282, (0.00622, 0.0332, 0.242), (0.000264, 0.000763, 0.209), (0.00849, 0.00912, 0.222)
    ),
    "degree 4, 2.7k": hertz_cloud(
        4, 39, 0.349, (0.00545, 0.0446, 0.272), (7.1e-5, 0.000256, 0.179), (0.00336, 0.00607, 0.17)
    ),
    "as in cases/": ["mls.degree=2"],
}
SLIP_CLOUDS = {
    "1.8k": graded_slip(20, 0.27, (0.0102, 0.057, 0.3), (0.00059, 0.00145, 0.27), (0.0014, 0.00206, 0.153)),
    "10k": graded_slip(
        18, 0.156, (0.0018, 0.0783, 0.199), (0.000131, 0.000614, 0.139), (0.00029, 0.0013, 0.115)
    ),
}
LEVELS = stages(*(f"{{press={k / 50}}}" for k in range(1, 51)))
SLIP = [stages("{press=1.0}", "{shear=1.0}"), "output.at=[2.0]"]

PARTS: dict[str, list[Entry]] = {
    "hertz": [
        *(mlsanm(label, "hertz", *settings) for label, settings in CLOUDS.items()),
        *PEERS["hertz"],
    ],
    "levels": [
        *(mlsanm(label, "hertz", LEVELS, *CLOUDS[label]) for label in ("1.6k", "degree 4, 1.7k")),
        *PEERS["levels"],
    ],
    "slip": [
        mlsanm("as in cases/", "cattaneo_mindlin", *SLIP),
        mlsanm("graded, 1.8k", "cattaneo_mindlin", *SLIP, *SLIP_CLOUDS["1.8k"]),
        mlsanm("graded, 10k", "cattaneo_mindlin", *SLIP, *SLIP_CLOUDS["10k"]),
        mlsanm("finer", "cattaneo_mindlin", *SLIP, *cloud(0.1, (0.0012, 0.056, 0.12), FINE_EDGE, KINKS[2:])),
        *PEERS["slip"],
    ],
    "history": [mlsanm("as in cases/", "cattaneo_mindlin", "output.at=[4.0]"), *PEERS["history"]],
    "patch": [mlsanm("cases/patch.toml", "patch"), *PEERS["patch"]],
}
