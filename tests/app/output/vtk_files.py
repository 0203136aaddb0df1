"""VTU and PVD files as other programs read them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import meshio
import numpy as np


def read(path: Path) -> Any:
    return meshio.read(path, file_format="vtu")


def listed(path: Path) -> list[dict[str, str]]:
    return [dict(one.attrib) for one in ET.parse(path).getroot().findall("Collection/DataSet")]


def area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, corner], :2] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.asarray(0.5 * twice)
