"""All scenes, registered."""

from benchmarks.scenes import (  # noqa: F401
    assemblies,
    assorted,
    beams,
    bending,
    fits,
    frictional,
    joints,
    layers,
    machines,
    mechanisms,
    pads,
    profiles,
    rounds,
    rubber,
    wedges,
)
from benchmarks.scenes.scene import SCENES

__all__ = ["SCENES"]
