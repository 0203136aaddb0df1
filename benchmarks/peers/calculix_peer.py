"""CalculiX: writes a deck, runs ccx, reads the contact pressures.

    python calculix_peer.py MESH.npz OUT.csv [--levels N]

Quadratic plane strain triangles on the mesh scikit-fem gets. The platen is moved by the displacement that the
reference solution has under the load: with a force the cylinder would be held by nothing before it touches.
Contact is face to face with a penalty; ccx's own mortar contact refuses plane elements.
Only Python's own modules and numpy; what is timed includes writing the deck and reading the results.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scenes import POISSON, RADIUS, YOUNG, write_profile

APPROACH = 0.00506974
REACH = 0.075
STIFFNESS = 3e8
"""Contact pressure per overlap: p0 overlaps by 1 % of the indentation, and a stiffer one took longer."""


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


def deck(mesh: str, levels: int) -> str:
    """Text of the input file."""
    with np.load(mesh) as arrays:
        upper, upper_triangles = quadratic(arrays["upper_triangles"], arrays["upper_points"])
        lower, lower_triangles = quadratic(arrays["lower_triangles"], arrays["lower_points"])
    points = np.vstack([upper, lower])
    triangles = np.vstack([upper_triangles, lower_triangles + len(upper)])
    x, y = points.T
    above = np.arange(len(points)) < len(upper)
    corners = np.zeros(len(points), dtype=bool)
    corners[triangles[:, :3]] = True
    on_arc = above & corners & (np.abs(np.hypot(x, y - RADIUS) - RADIUS) < 1e-9) & (np.abs(x) < REACH)
    on_top = ~above & (np.abs(y) < 1e-12) & (np.abs(x) < 1.5 * REACH)
    text = ["*NODE\n"]
    text += [f"{number},{a:.12g},{b:.12g},0\n" for number, (a, b) in enumerate(points, 1)]
    text.append("*ELEMENT,TYPE=CPE6,ELSET=ALL\n")
    text += [f"{number},{','.join(map(str, row + 1))}\n" for number, row in enumerate(triangles, 1)]
    text.append(lines("FLAT", np.flatnonzero(above & (y > RADIUS - 1e-9))))
    text.append(lines("BOTTOM", np.flatnonzero(~above & (y < lower[:, 1].min() + 1e-9))))
    text.append(surface("SLAVE", upper_triangles, on_arc[: len(upper)], 0))
    text.append(surface("MASTER", lower_triangles, on_top[len(upper) :], len(upper_triangles)))
    text.append(
        f"*MATERIAL,NAME=STEEL\n*ELASTIC\n{YOUNG:g},{POISSON:g}\n*SOLID SECTION,ELSET=ALL,MATERIAL=STEEL\n"
        "1.\n"
        f"*SURFACE INTERACTION,NAME=LAW\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{STIFFNESS:g},{STIFFNESS / 1000:g}\n"
        f"*CONTACT PAIR,INTERACTION=LAW,TYPE=SURFACE TO SURFACE\nSLAVE,MASTER\n"
        f"*BOUNDARY\nBOTTOM,1,2\nFLAT,1,1\n"
        f"*STEP,INC=1000\n*STATIC,DIRECT\n{1.0 / levels:.9g},1.\n*BOUNDARY\nFLAT,2,2,{-APPROACH:.9g}\n"
        f"*CONTACT FILE,FREQUENCY=1000\nCDIS,CSTR\n*END STEP\n"
    )
    return "".join(text)


def pressures(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """x and contact pressure of the last CONTACT block of an .frd file; one layer of the two."""
    nodes: dict[int, tuple[float, float]] = {}
    values: dict[int, float] = {}
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
            values[int(line[3:13])] = float(line[49:61])
    profile: dict[float, float] = {}
    for node, value in values.items():
        x, y = nodes[node]
        on_arc = abs(x) < REACH and abs(np.hypot(x, y - RADIUS) - RADIUS) < 1e-6
        if on_arc and (value > 0.0 or abs(x) > 1e-9):  # the block, without pressures, has a node at x = 0 too
            profile[x] = value
    x = np.array(sorted(profile))
    return x, np.array([profile[at] for at in x])


def main(arguments: list[str]) -> None:
    levels = int(arguments[arguments.index("--levels") + 1]) if "--levels" in arguments else 1
    with tempfile.TemporaryDirectory() as directory:
        (Path(directory) / "case.inp").write_text(deck(arguments[0], levels))
        done = subprocess.run(["ccx", "-i", "case"], cwd=directory, capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stdout[-3000:])
        x, pressure = pressures(Path(directory) / "case.frd")
    write_profile(arguments[1], x, {"pressure": pressure})


if __name__ == "__main__":
    main(sys.argv[1:])
