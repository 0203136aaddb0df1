"""CalculiX: writes a deck, runs ccx, reads the contact pressures.

    python calculix_peer.py hertz|slip|patch MESH OUT.csv [--levels N] [--stiffness 3e8]

MESH is an .npz file or a name in meshes.py. Quadratic plane strain triangles. The platen is moved by the
displacements that the reference solution has under the loads: with a force the cylinder would be held by
nothing before it touches. Contact and friction are face to face with penalties, pressure per overlap and
traction per slip of what sticks; ccx's own mortar contact refuses plane elements.
Only Python's own modules and numpy; what is timed includes writing the deck and reading the results.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from meshes import Mesh, load
from scenes import FRICTION, PATCH_PRESSURE, POISSON, RADIUS, YOUNG, Array, write_profile

APPROACH, SIDEWAYS = 0.0050695, 0.0011566
REACH = 0.075
"""Displacements of the platen, and how far from the centre the arc may touch."""
PATCH_HEIGHT, PATCH_APPROACH = 1.0, 2.0 * PATCH_PRESSURE * (1.0 - POISSON**2) / YOUNG
"""Of the interface, and the exact displacement of the top of two blocks, each as high."""
ROUND_OFF = 1e-9
"""Of coordinates in a mesh."""


def quadratic(triangles: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and six-node triangles with nodes in the middles of the edges, counter-clockwise."""
    a, b, c = points[triangles.T]
    clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles = np.where(clockwise[:, None], triangles[:, [0, 2, 1]], triangles)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, place = np.unique(edges, axis=0, return_inverse=True)
    middles = points[unique].mean(axis=1)
    return np.vstack([points, middles]), np.column_stack([triangles, len(points) + place.reshape(-1, 3)])


def lines(name: str, numbers: np.ndarray) -> str:
    """A node set."""
    return f"*NSET,NSET={name}\n" + "".join(f"{number},\n" for number in numbers + 1)


def surface(name: str, triangles: np.ndarray, on: np.ndarray, first: int) -> str:
    """Faces of triangles both of whose ends lie in the mask ``on``; face k joins corners k and k+1."""
    rows = [f"*SURFACE,NAME={name},TYPE=ELEMENT\n"]
    for face in range(3):
        ends = triangles[:, [face, (face + 1) % 3]]
        rows += [f"{first + k + 1},S{face + 1}\n" for k in np.flatnonzero(on[ends].all(axis=1))]
    return "".join(rows)


def deck(mesh: Mesh, problem: str, levels: int, stiffness: float) -> str:
    """Text of the input file; the stages share the ``levels`` evenly."""
    upper, upper_triangles = quadratic(mesh["upper_triangles"], mesh["upper_points"])
    lower, lower_triangles = quadratic(mesh["lower_triangles"], mesh["lower_points"])
    points = np.vstack([upper, lower])
    triangles = np.vstack([upper_triangles, lower_triangles + len(upper)])
    x, y = points.T
    above = np.arange(len(points)) < len(upper)
    corners = np.zeros(len(points), dtype=bool)
    corners[triangles[:, :3]] = True
    patch, surface_y = problem == "patch", lower[:, 1].max()
    height = np.abs(y - surface_y) if patch else np.abs(np.hypot(x, y - RADIUS) - RADIUS)
    reach = np.inf if patch else REACH
    on_arc = above & corners & (height < ROUND_OFF) & (np.abs(x) < reach)
    on_top = ~above & (np.abs(y - surface_y) < ROUND_OFF) & (np.abs(x) < 1.5 * reach)
    text = ["*NODE\n"]
    text += [f"{number},{a:.12g},{b:.12g},0\n" for number, (a, b) in enumerate(points, 1)]
    text.append("*ELEMENT,TYPE=CPE6,ELSET=ALL\n")
    text += [f"{number},{','.join(map(str, row + 1))}\n" for number, row in enumerate(triangles, 1)]
    text.append(lines("FLAT", np.flatnonzero(above & (y > upper[:, 1].max() - ROUND_OFF))))
    text.append(lines("BOTTOM", np.flatnonzero(~above & (y < lower[:, 1].min() + ROUND_OFF))))
    text.append(surface("SLAVE", upper_triangles, on_arc[: len(upper)], 0))
    text.append(surface("MASTER", lower_triangles, on_top[len(upper) :], len(upper_triangles)))
    text.append(
        f"*MATERIAL,NAME=STEEL\n*ELASTIC\n{YOUNG:g},{POISSON:g}\n*SOLID SECTION,ELSET=ALL,MATERIAL=STEEL\n"
        "1.\n"
        f"*SURFACE INTERACTION,NAME=LAW\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{stiffness:g},{stiffness / 1000:g}\n"
        + (f"*FRICTION\n{FRICTION},{stiffness:g}\n" if problem == "slip" else "")
        + "*CONTACT PAIR,INTERACTION=LAW,TYPE=SURFACE TO SURFACE\nSLAVE,MASTER\n"
    )
    if patch:
        text.append(lines("LEFT", np.flatnonzero(x < ROUND_OFF)))
    text.append(f"*BOUNDARY\n{'LEFT,1,1' if patch else 'BOTTOM,1,1'}\nBOTTOM,2,2\n")
    stages = (0.0, SIDEWAYS) if problem == "slip" else (0.0,)
    for sideways in stages:
        platen = f"FLAT,2,2,{-PATCH_APPROACH:.9g}\n"
        if not patch:
            platen = f"FLAT,1,1,{sideways:.9g}\nFLAT,2,2,{-APPROACH:.9g}\n"
        text.append(
            f"*STEP,INC=1000\n*STATIC,DIRECT\n{len(stages) / levels:.9g},1.\n"
            f"*BOUNDARY\n{platen}"
            "*CONTACT FILE,FREQUENCY=1000\nCDIS,CSTR\n*END STEP\n"
        )
    return "".join(text)


def stresses(path: Path, patch: bool) -> tuple[Array, Array, Array]:
    """x, pressure and traction on the slave in the last CONTACT block of an .frd file.

    The program makes two layers of nodes from a plane; one of them is read.
    """
    nodes: dict[int, tuple[float, float]] = {}
    values: dict[int, tuple[float, float]] = {}
    block = ""
    for line in path.read_text().splitlines():
        if line.startswith("    2C"):
            block = "nodes"
        elif line.startswith(" -4"):
            block = "contact" if "CONTACT" in line else ""
            values = {} if block else values
        elif line.startswith(" -3"):
            block = ""
        elif line.startswith(" -1") and block == "nodes":
            nodes[int(line[3:13])] = (float(line[13:25]), float(line[25:37]))
        elif line.startswith(" -1") and block == "contact":
            values[int(line[3:13])] = (float(line[49:61]), -float(line[61:73]))
    profile: dict[float, tuple[float, float]] = {}
    for node, value in values.items():
        x, y = nodes[node]
        # Near the middle the arc is as low as the block: only relative to its height they can be told apart,
        # and where the height is 0 by the block's having no pressure.
        height = 0.0 if patch else x * x / (RADIUS + max(RADIUS**2 - x * x, 0.0) ** 0.5)
        off = (
            abs(y - PATCH_HEIGHT) > ROUND_OFF if patch else abs(y - height) > 1e-3 * height or abs(x) > REACH
        )
        if not off and (height > 0.0 or value[0] > 0.0):
            profile[x] = value
    x = np.array(sorted(profile))
    pressure, traction = np.array([profile[at] for at in x]).T
    return x, pressure, traction


def main(arguments: list[str]) -> None:
    problem, source, out = arguments[:3]
    options = {
        "--levels": "2" if problem == "slip" else "1",
        "--stiffness": "3e8",
        **dict(zip(arguments[3::2], arguments[4::2], strict=True)),
    }
    with tempfile.TemporaryDirectory() as directory:
        (Path(directory) / "case.inp").write_text(
            deck(load(source), problem, int(options["--levels"]), float(options["--stiffness"]))
        )
        done = subprocess.run(["ccx", "-i", "case"], cwd=directory, capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stdout[-3000:])
        x, pressure, traction = stresses(Path(directory) / "case.frd", problem == "patch")
    write_profile(out, x, {"pressure": pressure, "traction": traction})


if __name__ == "__main__":
    main(sys.argv[1:])
