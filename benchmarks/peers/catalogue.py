"""What is run: for every part the programs, each with the meshes or clouds that were found cheapest."""

from __future__ import annotations

import importlib.util
import json
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from meshes import Grading, hertz_mesh, patch_mesh
from scenes import HALF_WIDTH, RADIUS, STICK

HERE = Path(__file__).resolve().parent
CASES = HERE.parents[1] / "cases"


@dataclass(frozen=True)
class Job:
    """A command, the file it leaves, and what its mesh cost before."""

    command: list[str]
    result: Path
    mesh_seconds: float
    nodes: Callable[[], int]


@dataclass(frozen=True)
class Entry:
    """One point of a picture. ``needs`` is the package without which it is left out."""

    program: str
    label: str
    needs: str
    prepare: Callable[[Path], Job]


def missing() -> dict[str, str]:
    """Programs that cannot run here, and why."""
    absent = {}
    if importlib.util.find_spec("gmsh") is None:
        reason = "its meshes need gmsh (pip install gmsh)"
        return {"skfem": reason, "ccx": reason}
    if importlib.util.find_spec("skfem") is None:
        absent["skfem"] = "pip install scikit-fem"
    if shutil.which("ccx") is None:
        absent["ccx"] = "no ccx on the path (Debian: calculix-ccx)"
    return absent


def scikit_fem(program: str, label: str, problem: str, grading: Grading | None, *options: str) -> Entry:
    """The scikit-fem script on a mesh; without a grading on the patch test's."""

    def prepare(stem: Path) -> Job:
        mesh, out = stem.with_suffix(".npz"), stem.with_suffix(".csv")
        start = time.process_time()
        nodes = patch_mesh(mesh) if grading is None else hertz_mesh(mesh, grading)
        command = [sys.executable, str(HERE / "skfem_peer.py"), problem, str(mesh), str(out), *options]
        return Job(command, out, time.process_time() - start, lambda: nodes)

    return Entry(program, label, "skfem", prepare)


def calculix(label: str, grading: Grading, *options: str) -> Entry:
    """The CalculiX script on a mesh."""

    def prepare(stem: Path) -> Job:
        mesh, out = stem.with_suffix(".npz"), stem.with_suffix(".csv")
        start = time.process_time()
        nodes = hertz_mesh(mesh, grading)
        command = [sys.executable, str(HERE / "calculix_peer.py"), str(mesh), str(out), *options]
        return Job(command, out, time.process_time() - start, lambda: nodes)

    return Entry("CalculiX", label, "ccx", prepare)


def mlsanm(label: str, case: str, *settings: str) -> Entry:
    """``mlsanm run`` without caches and pictures, with the exact laws."""

    def prepare(stem: Path) -> Job:
        given = ["output.vtu=false", 'contact.interface.regularization.law="exact"', *settings]
        command = [sys.executable, "-m", "mlsanm_cli.cli", "run", str(CASES / f"{case}.toml"), "--quiet"]
        command += ["--no-cache", "--force", "--threads", "1", "--out", str(stem)]
        command += [part for text in given for part in ("--set", text)]
        summary = stem / "summary.json"
        return Job(
            command, stem / "interface.csv", 0.0, lambda: int(json.loads(summary.read_text())["nodes"])
        )

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


KINKS = (-HALF_WIDTH, -STICK, STICK, HALF_WIDTH)
FINE_EDGE = (0.00015, 0.0015, 0.12)
GRADED = {
    "coarse": Grading(0.0008, 0.008, 0.6, 0.4),
    "medium": Grading(0.0004, 0.005, 0.5, 0.3),
    "fine": Grading(0.0002, 0.003, 0.3, 0.3),
    "finest": Grading(0.0001, 0.002, 0.22, 0.25),
}
EVEN = {f"a/{n}": Grading(1.0, HALF_WIDTH / n, 0.3, 0.3, even=1.2 * HALF_WIDTH) for n in (10, 20, 40, 80)}
KINKED = {
    "coarse": Grading(0.0008, 0.006, 0.5, 0.3, KINKS),
    "fine": Grading(0.0002, 0.0025, 0.3, 0.3, KINKS),
}
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
        *(scikit_fem("scikit-fem, graded", label, "hertz", grading) for label, grading in GRADED.items()),
        *(scikit_fem("scikit-fem, even", label, "hertz", grading) for label, grading in EVEN.items()),
        calculix("coarse", GRADED["coarse"]),
        calculix("medium", GRADED["medium"]),
    ],
    "levels": [
        *(mlsanm(label, "hertz", LEVELS, *CLOUDS[label]) for label in ("1.6k", "degree 4, 1.7k")),
        *(
            scikit_fem(f"scikit-fem, {way}", label, "hertz", GRADED[label], "--levels", "50", *option)
            for way, option in (("condensed", ()), ("sparse", ("--sparse",)))
            for label in ("coarse", "medium")
        ),
    ],
    "slip": [
        mlsanm("as in cases/", "cattaneo_mindlin", *SLIP),
        mlsanm("graded, 1.8k", "cattaneo_mindlin", *SLIP, *SLIP_CLOUDS["1.8k"]),
        mlsanm("graded, 10k", "cattaneo_mindlin", *SLIP, *SLIP_CLOUDS["10k"]),
        mlsanm("finer", "cattaneo_mindlin", *SLIP, *cloud(0.1, (0.0012, 0.056, 0.12), FINE_EDGE, KINKS[2:])),
        *(
            scikit_fem(
                "scikit-fem, condensed", f"{label}, {levels} levels", "slip", grading, "--levels", levels
            )
            for label, grading in KINKED.items()
            for levels in ("2", "20")
        ),
        scikit_fem(
            "scikit-fem, sparse", "fine, 20 levels", "slip", KINKED["fine"], "--levels", "20", "--sparse"
        ),
    ],
    "history": [
        mlsanm("as in cases/", "cattaneo_mindlin", "output.at=[4.0]"),
        *(
            scikit_fem(f"scikit-fem, {way}", label, "history", KINKED[label], "--levels", "60", *option)
            for way, option in (("condensed", ()), ("sparse", ("--sparse",)))
            for label in KINKED
        ),
    ],
    "patch": [
        mlsanm("cases/patch.toml", "patch"),
        scikit_fem("scikit-fem, mortar", "same spacings", "patch", None),
    ],
}
