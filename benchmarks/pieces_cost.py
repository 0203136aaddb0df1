"""What pieces cost and save: CPU seconds of operators, factor and one solution at degree 4, with them and
without.

    python benchmarks/pieces_cost.py thin [--repeat 3]
    python benchmarks/pieces_cost.py hertz [--repeat 2]

``thin`` also gives the error of the compliance, on ever finer clouds of a ring, a cantilever and a compact
block. ``hertz`` takes the half-disk and the block of cases/hertz.toml with nodes a hundred times as fine
around the contact as away from it, 5,000 to 86,000 in all, and a ring of R/t = 20 with 13,000 nodes. Writes
pieces_cost.json (``--out``).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import scipy.sparse as sparse

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import thin_bodies
from benchmarks.thin_bodies import MATERIAL, REFERENCES, RESULTS, Thin, cantilever, ring, solved
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import Outline, half_disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.mechanics import pieces
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.operators.settings import MlsSettings


def block() -> Thin:
    """A compact body, clamped below and pressed on a fifth of its top."""

    def traction(name: str, points: FloatArray) -> FloatArray:
        values, away = np.zeros_like(points), np.abs(points[:, 0])
        if name == "top":
            values[:, 1] = -np.where(away < 0.4, np.cos(0.5 * np.pi * away / 0.4) ** 2, 0.0)
        return values

    return Thin("block", rectangle((-2.0, 2.0), (-2.0, 0.0)), ("bottom",), traction)


COSTS = ((ring(20), (5, 7, 10)), (cantilever(5), (5, 9, 17, 33)), (block(), (9, 17, 33)))
"""Bodies and the nodes across their thickness, or across a length of 1."""
FINEST = 49
"""Nodes across a length of 1 of the block that others are held against."""


def thin(repeat: int) -> list[dict[str, Any]]:
    """Errors of the compliance in percent and CPU seconds, the least of so many times, with and without
    pieces."""
    lines = []
    true = REFERENCES | {"block": solved(block(), FINEST, 4)[0]}
    for thin, across in COSTS:
        for count in across:
            line: dict[str, Any] = {"body": thin.name, "across": count}
            for _ in range(repeat):
                for name, known in (("with", pieces.Pieces.rows_known), ("without", _nothing_known)):
                    with mock.patch.object(pieces.Pieces, "rows_known", known):
                        work, spent, line["nodes"] = _timed(thin, count)
                    line[f"error {name}"] = 100.0 * (work / true[thin.name] - 1.0)
                    line[f"cpu {name}"] = min(line.get(f"cpu {name}", np.inf), spent)
            lines.append(line)
            print(line, flush=True)
    return lines


SCALES, GROWTH = (1.0, 0.4, 0.16), 0.12
"""Of all spacings around Hertz' contact, for 5,000, 17,000 and 86,000 nodes, and their growth."""


def hertz(repeat: int) -> list[dict[str, Any]]:
    """CPU seconds, the least of so many times, with and without pieces, and nodes."""
    lines = []
    for scale in SCALES:
        near = [((0.0, 0.0), 0.004, 0.07), *(((x, 0.0), 0.0005, 0.004) for x in (-0.05, 0.05))]
        zones = tuple(Zone.around(at, scale * h, radius, GROWTH) for at, h, radius in near)
        parts = [
            (half_disk((0.0, 1.0), 1.0, "lower"), ()),
            (rectangle((-2.0, 2.0), (-2.0, 0.0)), ("bottom",)),
        ]
        lines.append(_compared(f"hertz {scale:g}", parts, Spacing(0.1 * scale, zones), repeat))
    lines.append(_compared("ring 20", [(ring(20).outline, ())], Spacing(1.0 / 10.6), repeat))
    return lines


def _compared(
    name: str, parts: list[tuple[Outline, tuple[str, ...]]], spacing: Spacing, repeat: int
) -> dict[str, Any]:
    """The line of :func:`hertz` for bodies of such outlines and clamped sides."""
    clouds = [build_cloud(outline, spacing, 0) for outline, _ in parts]
    line: dict[str, Any] = {"bodies": name, "nodes": sum(len(cloud.points) for cloud in clouds)}
    for cloud in clouds:
        _ = cloud.triangles, cloud.areas, cloud.mirror  # made once, for both
    for _ in range(repeat):
        for how, known in (("with", pieces.Pieces.rows_known), ("without", _nothing_known)):
            begun = time.process_time()
            with mock.patch.object(pieces.Pieces, "rows_known", known):
                for cloud, (_, clamped) in zip(clouds, parts, strict=True):
                    model = BodyModel.build("body", cloud, MATERIAL, MlsSettings(4))
                    body = assemble(model, dict.fromkeys(clamped, (True, True)), [], "auto")
                    body.system.solve(sparse.csc_array(np.ones((body.rows, 1))))
            line[f"cpu {how}"] = min(line.get(f"cpu {how}", np.inf), time.process_time() - begun)
    print(line, line["cpu with"] / line["cpu without"], flush=True)
    return line


def _nothing_known(division: pieces.Pieces, hidden: list[tuple[int, int]]) -> FloatArray:
    return np.zeros(3 * division.count, dtype=bool)


def _timed(thin: Thin, across: int) -> tuple[float, float, int]:
    """Work of the loads, CPU seconds of operators, factor and a solution, and nodes."""
    told, assembled = list[Any](), assemble

    def watched(model: BodyModel, *arguments: Any) -> Any:
        begun = time.process_time()
        body = assembled(model, *arguments)
        body.system.solve(sparse.csc_array(np.ones((body.rows, 1))))
        told.extend([time.process_time() - begun, len(model.cloud.points)])
        return body

    with mock.patch.object(thin_bodies, "assemble", watched):
        work = solved(thin, across, 4)[0]
    return work, told[0], told[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["thin", "hertz"])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--out", type=Path, default=RESULTS / "pieces_cost.json")
    given = parser.parse_args()
    kept = json.loads(given.out.read_text()) if given.out.exists() else {}
    kept[given.what] = (thin if given.what == "thin" else hertz)(given.repeat)
    given.out.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
