"""What mlsanm is compared with: for every part the other programs, on meshes named in meshes.py.

"graded" and "even" are meshes for an active set on the condensed compliance, by which mlsanm solves its exact
laws too; "sparse" and "Newton" factorise anew in every iteration.
"""

from __future__ import annotations

from entries import Entry, peer
from meshes import EVEN

SIZES = ("coarse", "medium", "fine", "finest")
BOTH = (("scikit-fem", "skfem", ()), ("GetFEM", "getfem", ("--condensed",)))
"""Programs whose matrices the active set gets, and the options for that."""


def graded(program: str, script: str, sizes: tuple[str, ...], part: str, *options: str) -> list[Entry]:
    """A program on meshes graded to the ends of the contact."""
    return [peer(program, size, script, part, f"graded-{size}", *options) for size in sizes]


def kinked(program: str, script: str, part: str, size: str, levels: int, *options: str) -> Entry:
    """A program on a mesh graded to the ends of contact and stick zone, in so many load levels."""
    label = f"{size}, {levels} levels"
    return peer(program, label, script, part, f"kinked-{size}", "--levels", str(levels), *options)


PEERS: dict[str, list[Entry]] = {
    "hertz": [
        *(
            entry
            for name, script, ways in BOTH
            for entry in (
                *graded(f"{name}, graded", script, SIZES, "hertz", *ways),
                *(peer(f"{name}, even", f"a/{n}", script, "hertz", f"even-{n}", *ways) for n in EVEN),
            )
        ),
        *graded("GetFEM, Newton", "getfem", SIZES[:3], "hertz"),
        *graded("CalculiX", "calculix", SIZES[:1], "hertz", "--stiffness", "1e8"),
        *graded("CalculiX", "calculix", SIZES[1:3], "hertz", "--stiffness", "3e8"),
    ],
    "levels": [
        *(
            entry
            for name, script, ways in BOTH
            for entry in graded(f"{name}, condensed", script, SIZES[:2], "hertz", "--levels", "50", *ways)
        ),
        *graded("scikit-fem, sparse", "skfem", SIZES[:2], "hertz", "--levels", "50", "--sparse"),
        *graded("GetFEM, Newton", "getfem", SIZES[:2], "hertz", "--levels", "50"),
    ],
    "slip": [
        *(
            kinked(f"{name}, condensed", script, "slip", size, levels, *ways)
            for name, script, ways in BOTH
            for size, levels in (("coarse", 2), ("coarse", 20), ("fine", 2), ("fine", 40))
        ),
        kinked("scikit-fem, sparse", "skfem", "slip", "fine", 20, "--sparse"),
        kinked("GetFEM, Newton", "getfem", "slip", "coarse", 2),
        kinked("GetFEM, Newton", "getfem", "slip", "coarse", 20),
        kinked("GetFEM, Newton", "getfem", "slip", "fine", 2),
        kinked("CalculiX", "calculix", "slip", "coarse", 2),
        kinked("CalculiX", "calculix", "slip", "fine", 2),
    ],
    "history": [
        *(
            kinked(f"{name}, condensed", script, "history", size, 60, *ways)
            for name, script, ways in BOTH
            for size in ("coarse", "fine")
        ),
        *(
            kinked("scikit-fem, sparse", "skfem", "history", size, 60, "--sparse")
            for size in ("coarse", "fine")
        ),
        kinked("GetFEM, Newton", "getfem", "history", "coarse", 60),
    ],
    "patch": [
        peer("scikit-fem, mortar", "same spacings", "skfem", "patch", "patch"),
        peer("GetFEM, Newton", "same spacings", "getfem", "patch", "patch"),
        peer("CalculiX", "same spacings", "calculix", "patch", "patch"),
    ],
}
