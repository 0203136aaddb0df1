"""What is run: for every part mlsanm on the clouds that were found cheapest, and its peers."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from entries import HERE, Entry, Job
from programs import PEERS
from scenes import HALF_WIDTH, RADIUS, STICK

CASES = HERE.parents[1] / "cases"


def mlsanm(label: str, case: str, *settings: str) -> Entry:
    """``mlsanm run`` without caches and pictures, with the exact laws."""

    def prepare(stem: Path) -> Job:
        given = ["output.vtu=false", 'contact.interface.regularization.law="exact"', *settings]
        command = [sys.executable, "-m", "mlsanm_cli.cli", "run", str(CASES / f"{case}.toml"), "--quiet"]
        command += ["--force", "--threads", "1", "--out", str(stem)]
        command += [part for text in given for part in ("--set", text)]
        summary = stem / "summary.json"
        nodes = lambda: int(json.loads(summary.read_text())["nodes"])  # noqa: E731
        return Job({"geometry": command}, stem / "interface.csv", nodes)

    return Entry("mlsanm", label, "mlsanm", prepare)


def cloud(
    coarse: float,
    zone: tuple[float, float, float],
    edge: tuple[float, float, float],
    adjacent: tuple[tuple[float, float, float], ...] = (),
    stick: tuple[tuple[float, float, float], ...] = (),
) -> list[str]:
    """Settings of both bodies: spacing far away; spacing, radius, growth of the zone, of ``edge`` and
    what lies ``adjacent`` it at the ends of the contact, and of what lies where sticking ends."""

    def refinements(body: str) -> str:
        ends = [(HALF_WIDTH, *one) for one in (edge, *adjacent)] + [(STICK, *one) for one in stick]
        places = [(0.0, *zone), *((sign * x, *one) for x, *one in ends for sign in (-1, 1))]
        # On the arc, not next to it: a fine radius may be smaller than the arc's height there.
        height = {"cylinder": lambda x: RADIUS - (RADIUS**2 - x**2) ** 0.5, "block": lambda _x: 0.0}[body]
        return ", ".join(
            f"{{at=[{x:.6g}, {height(x):.6g}], spacing={spacing}, radius={radius}, growth={growth}}}"
            for x, spacing, radius, growth in places
        )

    bodies = ("cylinder", "block")
    refine = [f"body.{body}.refine=[{refinements(body)}]" for body in bodies]
    return [*refine, *(f"body.{body}.spacing={coarse}" for body in bodies)]


def fitted(degree: int, neighbors: int, cloud: list[str]) -> list[str]:
    """Settings of a cloud and of the local polynomials on it."""
    return [*cloud, f"mls.degree={degree}", f"mls.neighbors={neighbors}"]


def stages(*factors: str) -> str:
    """An override of a case's stages."""
    return f"stage=[{', '.join(factors)}]"


CLOUDS = {
    "1.7k": fitted(2, 17, cloud(0.335, (0.01255, 0.0586, 0.274), (0.001147, 0.002065, 0.157))),
    "degree 4, 2k": fitted(
        4,
        35,
        cloud(
            0.6607,
            (0.007169, 0.02233, 0.2389),
            (0.0003245, 0.0007424, 0.1744),
            adjacent=((0.01726, 0.01275, 0.2452),),
        ),
    ),
    "degree 4, 2.9k": fitted(
        4,
        35,
        cloud(
            0.503,
            (0.00545, 0.05115, 0.1587),
            (6.667e-5, 0.0002569, 0.179),
            adjacent=((0.002976, 0.00569, 0.1823),),
        ),
    ),
    "as in cases/": ["mls.degree=2"],
}
SLIP_CLOUDS = {
    "1.8k": fitted(
        2,
        20,
        cloud(0.27, (0.0102, 0.057, 0.3), (0.00059, 0.00145, 0.27), stick=((0.0014, 0.00206, 0.153),)),
    ),
    "2.5k": fitted(
        2, 20, cloud(0.27, (0.0075, 0.057, 0.3), (0.00027, 0.00065, 0.27), stick=((0.0006, 0.002, 0.153),))
    ),
    "degree 4, 5k": fitted(
        4,
        39,
        cloud(
            0.35,
            (0.001476, 0.03429, 0.2569),
            (0.0001413, 0.0003619, 0.1752),
            adjacent=((0.00236, 0.004795, 0.1858),),
            stick=((0.0002082, 0.000539, 0.1474), (0.002761, 0.005197, 0.18)),
        ),
    ),
}
LEVELS = stages(*(f"{{press={k / 50}}}" for k in range(1, 51)))
END = "output.at=[4.0]"
SLIP = [stages("{press=1.0}", "{shear=1.0}"), "output.at=[2.0]"]

PARTS: dict[str, list[Entry]] = {
    "hertz": [
        *(mlsanm(label, "hertz", *settings) for label, settings in CLOUDS.items()),
        *PEERS["hertz"],
    ],
    "levels": [
        *(mlsanm(label, "hertz", LEVELS, *CLOUDS[label]) for label in ("1.7k", "degree 4, 2k")),
        *PEERS["levels"],
    ],
    "slip": [
        mlsanm("as in cases/", "cattaneo_mindlin", *SLIP),
        *(mlsanm(label, "cattaneo_mindlin", *SLIP, *settings) for label, settings in SLIP_CLOUDS.items()),
        *PEERS["slip"],
    ],
    "history": [
        mlsanm("as in cases/", "cattaneo_mindlin", END),
        *(mlsanm(label, "cattaneo_mindlin", END, *settings) for label, settings in SLIP_CLOUDS.items()),
        *PEERS["history"],
    ],
    "patch": [mlsanm("cases/patch.toml", "patch"), *PEERS["patch"]],
}
