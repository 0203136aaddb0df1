"""Everything that can be wrong with a case: each fault with its key and what to write instead."""

from __future__ import annotations

import pytest

from mlsanm_cli.case import resolved_mapping
from mlsanm_cli.io.files import toml_text
from tests.case.scenes import BLOCK, CLAMP, HERTZ, PLATE, PULL, SQUARE, WAVY, parse, problems

Change = str | tuple[str, str]
Row = tuple[Change, str, str]
PULLED = SQUARE + CLAMP + PULL
PLATEN = "[[load]]\nname = 'plate'\nboundary = 'square.top'\nkind = 'platen'\nfx = 0.0\n"


VALUES: list[Row] = [
    (("spacing = 4.0", "spacign = 4.0"), "body.cylinder.spacign", 'did you mean "spacing"'),
    (("spacing = 4.0", "h = 4.0"), "body.cylinder.h", 'did you mean "spacing"'),
    (("format = 1", "format = 1\nfriction = 0.2"), "friction", "did you mean contact.friction?"),
    ("body.0.spacing=-4.0", "body.cylinder.spacing", "a number above 0"),
    ("body.0.seed=1.0", "body.cylinder.seed", "whole number"),
    ("body.0.name='my.block'", "body.my.block.name", "letters, digits"),
    ("body.0.shape=3", "body.cylinder.shape", "expected a table"),
    ("body.0.shape={kind=3}", "body.cylinder.shape.kind", 'unknown kind "3"'),
    ("body.0.shape.kind='half_disc'", "body.cylinder.shape.kind", '"half-disk"'),
    (('kind = "half-disk"\n', ""), "body.cylinder.shape.kind", "missing"),
    ("body.0.refine.0.spacing='4'", "body.cylinder.refine.0.spacing", 'without quotes: "4" is text'),
    ("body=[]", "body", "the list is empty"),
    (("E = 210e3\n", ""), "material.steel.E", "missing"),
    (("E = 210e3", 'E = "210 GPa"'), "material.steel.E", "numbers have no units"),
    ("material.steel.nu=0.51", "material.steel.nu", "at most 0.5"),
    ("model.plane='strian'", "model.plane", 'did you mean "strain"'),
    ("model.plane='shell'", "model.plane", "valid: strain, stress"),
    (("[model]", "[[model]]"), "model", "single brackets"),
    (("format = 1\n", ""), "format", "write format = 1"),
    (("[[support]]", "[support]"), "support", "write [[support]]"),
    ("load.press.force=[0.0]", "load.press.force", "two numbers"),
    ("load.press.force=[0.0, nan]", "load.press.force.1", "nan and inf"),
    (("force = [0.0, -350.0]", "fy = '-350 N'"), "load.press.fy", "no units"),
    ("contact.0.master=7", "contact.interface.master", '"<body>.<boundary>"'),
    ("contact.0.regularization.eta=-1e-4", "contact.interface.regularization.eta", "greater than 0"),
    ("solver.order=1", "solver.order", "at least 2"),
    ("solver.tolerance=1.0", "solver.tolerance", "less than 1"),
    ("solver.pade=1", "solver.pade", "true or false"),
    ("[[stage]]\npress = nan", "stage.0.press", "nan and inf"),
]
RING = "body.1.shape={kind='annulus', center=[0, 0], radii=[2.0, 1.0]}"
ON_DISK = 'friction = "bonded"\nobstacle = {kind = "disk", center = [0, 0], radius = 1}'
YIELDS, ROWS = "E = 210e3\nyield_stress = 250.0", "hardening_table"
RELATIONS: list[Row] = [
    (("E = 210e3", "E = 210e3\nhardening = 1e3"), "material.steel.yield_stress", "missing"),
    (("E = 210e3", f"{YIELDS}\nludwik = [1e3, 0.2]\nhardening = 1"), "material.steel.ludwik", "is given too"),
    (("E = 210e3", f"{YIELDS}\nludwik = [1e3, 1.2]"), "material.steel.ludwik", "at most 1"),
    (("E = 210e3", f"{YIELDS}\n{ROWS} = [[0.01, 240.0]]"), f"material.steel.{ROWS}.0", "do not decrease"),
    (("E = 210e3", f"{YIELDS}\n{ROWS} = [[0.02, 260], [0.01, 270]]"), f"material.steel.{ROWS}.1", "increase"),
    (("E = 210e3", f'{YIELDS}\nlaw = "neo-hookean"'), "material.steel.yield_stress", 'law = "linear"'),
    ("body.0.material='steal'", "body.cylinder.material", 'did you mean "steel"'),
    (('name = "block"', 'name = "cylinder"'), "body.cylinder.name", "already"),
    ("[material.gum]\nE = 1\nnu = 0\n", "material.gum", "no body uses"),
    ("material.steel.nu=0.5", "material.steel.nu", "plane strain"),
    ("contact.0.master='block.tpo'", "contact.interface.master", 'did you mean "block.top"'),
    ("contact.0.master='blocks.top'", "contact.interface.master", 'did you mean "block"'),
    ("contact.0.master='cylinder.arc'", "contact.interface.master", "same boundary"),
    ("contact.0.master='cylinder.flat'", "contact.interface", "not supported yet"),
    ("load.0.boundary='cylinder.top'", "load.press.boundary", "no boundary"),
    ("body.1.refine.0.along='cylinder.arc'", "body.block.refine.0.along", "boundaries: "),
    ("body.1.shape.x=[1.0, 1.0]", "body.block.shape.x", "not a range"),
    (RING, "body.block.shape.radii", "the inner and the outer"),
    ("body.0.spacing=101.0", "body.cylinder.spacing", "larger than the body"),
    ("body.0.refine.0.spacing=5.0", "body.cylinder.refine.0.spacing", "larger than the body's"),
    (("at = [0.0, 0.0]\n", ""), "body.cylinder.refine.0", 'one of "at", "along"'),
    (("at = [0.0, 0.0]", 'at = [0.0, 0.0]\nalong = "arc"'), "body.cylinder.refine.0.along", '"at" is given'),
    (("ux = 0.0\nuy = 0.0\n", ""), "support.0", "fixes nothing"),
    (("force = [0.0, -350.0]\n", ""), "load.press", "needs a direction"),
    (("force = [", "displacement = [0.0, 1.0]\nforce = ["), "load.press.displacement", '"force" is given'),
    (("force = [", "uy = 1.0\nforce = ["), "load.press.uy", '"force" gives both'),
    (("force = [0.0, -350.0]", "ux = 0.0\nfx = 1.0"), "load.press.fx", '"ux" is given'),
    ("[[stage]]\npres = 1.0\npress = 1.0", "stage.0.pres", 'did you mean "press"'),
    ("[[stage]]\n[[stage]]\npress = 1.0", "stage.0", "loads: press"),
    ("[[stage]]\npress = 1.0\n[output]\nat = [0.0, 1.0, 1.01]", "output.at.2", "from 0 to 1"),
    ("output.fields=['stress', 'stress']", "output.fields", "2 times"),
    ("[mls]\ndegree = 4\nneighbors = 14", "mls.neighbors", "15 terms"),
    ('contact.0.friction="glued"', "contact.interface.friction", '"bonded"'),
    (('"block.top"', '"block.top"\nfriction = "bonded"\ngap = 1'), "contact.interface.gap", "bonded"),
    (('master = "block.top"', ON_DISK), "contact.interface.friction", "rigid obstacle"),
    ("[[stop]]\nwhat = 'force'\nof = 'pres'\nabove = 1.0", "stop.0.of", "no load or contact or support"),
    ("[[stop]]\nwhat = 'force'\nof = 'press'", "stop.0", 'one of "above", "below"'),
    ("[[stop]]\nwhat = 'force'\nof = 'press'\nabove = 1.0\nbelow = 2.0", "stop.0.below", "is given too"),
    ("[[stop]]\nwhat = 'slip'\nof = 'interface'\nabove = 1.0", "stop.0.of", "frictionless"),
    ("stop=[{what='area', of='interface', above=1.0, component='x'}]", "stop.0.component", "no components"),
    ("[[stop]]\nwhat = 'fold'\nabove = 1.0", "stop.0.above", "fold"),
]
PARTS: list[Row] = [
    ("[[support]]\nbody = 'square'\nux = 0", "support.1", "near"),
    ("[[support]]\nboundary = 'square.top'\nnear = [0, 0]\nux = 0", "support.1", "either"),
    ("[[support]]\nux = 0", "support.1", "near"),
    ("[[support]]\nbody = 'sqare'\nnear = [0, 0]\nux = 0", "support.1.body", 'did you mean "square"'),
    ("[[support]]\nboundary = 'square.top'\nspring = [-1, 2]", "support.1.spring", "above 0"),
    ("[[support]]\nbody = 'square'\nnear = [0, 0]\nspring = [1, 1]", "support.1.spring", "boundary"),
    ("support.0.uy=0.1", "support.0.uy", "not supported yet"),
    ("support.0.from=[0, 0]", "support.0.from", 'needs "to" too'),
    ("stage=[{}]", "load.pull", "no stage applies"),
    (PLATEN + "moment = 1.0\nrotation = 'fixed'", "load.plate.moment", "free to rotate"),
    (PLATEN + "hinge = [0.0, 0.0]\nrotation = 'fixed'", "load.plate.hinge", "can rotate"),
    (PLATEN + "rotation = 'loose'", "load.plate.rotation", 'expected "fixed", "free", or an angle'),
]
BOLT = "[{center=[1.0, 1.0], radius=0.4}"
OUTLINES = [
    ("plate", "points=[[0.0, 0.0], [1.0, 0.0]]", "points", "at least 3"),
    ("plate", "names=['a', 'b']", "names", "2 items for 6 points"),
    ("plate", "rounding=[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]", "rounding.2", "at least 0"),
    ("plate", "rounding=[0.0, 0.0, 0.0, 2.5, 0.0, 0.0]", "rounding.3", "at most 2"),
    ("plate", "rounding=[0.0, 0.0, 1.2, 1.0, 0.0, 0.0]", "rounding.2", "has 1 left"),
    ("plate", "names=['bolt', 'tip', 'a', 'b', 'c', 'bolt']", "names.0", "two boundaries"),
    ("plate", "names=['x', 'tip', 'corner3', 'b', 'c', 'left']", "names.2", "two boundaries"),
    ("plate", "holes.bolt.name='left'", "names.5", "two boundaries"),
    ("plate", "holes.bolt.radius=1.1", "holes.bolt.radius", "cuts the boundary"),
    ("plate", "holes.bolt.center=[3.0, 3.0]", "holes.bolt.center", "outside"),
    ("plate", "holes.bolt.center=[2.0, 2.0]", "holes.bolt.radius", '"corner4"'),
    ("plate", f"holes={BOLT}, {{center=[1.6, 1.0], radius=0.3}}]", "holes.1.center", "holes"),
    ("block", "sides.right.to=[4.0, 2.0]", "sides", "cross or touch"),
    ("block", "sides.left.to=[0.0, -0.5]", "sides.top", '"left" ends at (0, -0.5)'),
    ("block", "sides.right.points=[[4.0, 0.0], [4.0, -1.0]]", "sides.right.points", '"to" is given too'),
    ("block", "sides.top.points=[[0.0, 0.0], [0.0, 0.0]]", "sides.top.points.1", "repeats"),
    ("block", "sides=[{to = [1.0, 0.0]}, {}]", "sides.0", "is missing"),
]
REGIONS = [
    ("load.press.to=[1.0, 0.1]", "load.press.to", "the same point"),
    ("support.0.boundary=['block.left', 'block.left']", "support.0.boundary", "listed twice"),
    ("support.0.boundary=['block.left', 'other.top']", "support.0.boundary", "one body"),
    ("support.0.boundary=['block.left', 'block.lid']", "support.0.boundary.1", 'no boundary "lid"'),
]
ISOTROPIC = "E = 1\nnu = 0.5\n"
WOOD = "E1 = 10\nE2 = 1\nG12 = 0.5\nnu12 = 0.3\n"
THIRD = "E3 = 2\nnu13 = 0.3\nnu23 = 0.2\n"
FULL = "stiffness = [[3, 1, 0], [1, 2, 0], [0, 0, 1]]\n"
MATERIALS = [
    ("", "stress", "E", "E, nu; or E1, E2, G12, nu12; or stiffness"),
    ("nu = 0.3\n", "stress", "E", "missing"),
    ("E1 = 10\nE2 = 1\nG12 = 0.5\n", "stress", "nu12", "missing"),
    (WOOD + "E = 1\n", "stress", "E", "E1, E2, G12, nu12"),
    (WOOD + FULL, "stress", "E1", "stiffness"),
    (ISOTROPIC + FULL, "stress", "nu", "stiffness"),
    (ISOTROPIC + "angle = 3\n", "stress", "E", "E1, E2, G12, nu12"),
    (WOOD, "strain", "E3", "plane strain"),
    (WOOD.replace("0.3", "3.2"), "stress", "nu12", "not between -3.16228 and 3.16228"),
    (WOOD + THIRD.replace("0.2", "0.8"), "stress", "nu23", "E2/E3"),
    (WOOD.replace("0.3", "2.5") + THIRD.replace("0.3", "1.8"), "strain", "nu12", "together"),
    (FULL.replace("[3, 1, 0], [1", "[3, 4, 0], [4"), "stress", "stiffness", "positive definite"),
    ("stiffness = [[3, 1, 2.5], [1, 2, 0], [2.5, 0, 1]]\n", "stress", "stiffness", "positive definite"),
    (FULL.replace("[3, 1, 0]", "[3, 1.1, 0]"), "stress", "stiffness", "not symmetric"),
    ("stiffness = [[3, 1], [1, 2]]\n", "stress", "stiffness", "three rows of three numbers"),
    (ISOTROPIC + "alpha = [1, 2, 3]\n", "stress", "alpha", "isotropic"),
    (WOOD + "alpha = [1, 2]\n", "stress", "alpha", "a list of three"),
    (FULL + "alpha = 1e-5\n", "strain", "alpha", "[xx, yy, 2xy]"),
]
MORE = '[[load]]\nname = "more"\n'
TOP, BODY = 'boundary = "square.top"\n', 'body = "square"\n'
LOADS = [
    (TOP + 'kind = "traction"', "", 'needs one of "traction", "table"'),
    (TOP + 'kind = "pressure"', "", 'needs one of "pressure", "table"'),
    (TOP + 'kind = "pressure"\npressure = 1\ntable = [[0, 1], [1, 1]]', "table", '"pressure" is given too'),
    (TOP + 'kind = "pressure"\npressure = "os.remove(1)"', "pressure", '"os.remove" cannot be called'),
    (TOP + 'kind = "pressure"\npressure = true', "pressure", "expression in x and y"),
    (TOP + 'kind = "pressure"\ntable = [[0, 1]]', "table", "two rows"),
    (TOP + 'kind = "pressure"\ntable = [[0, 1], [0, 2]]', "table", "row 2 has 0 after 0"),
    (TOP + 'kind = "pressure"\ntable = "none.csv"', "table", "there is no file"),
    (TOP + 'kind = "displacement"', "", 'needs one of "displacement", "ux", "uy"'),
    (TOP + 'kind = "displacement"\nux = 1\ndisplacement = [1, 1]', "ux", '"displacement" is given too'),
    (TOP + 'kind = "body-force"\nbody-force = [0, 1]', "body", "missing"),
    (BODY + 'kind = "body-force"\nbody_force = [0, 1]', "body_force", 'did you mean "body-force"'),
    (BODY + 'kind = "temperature"\nvalue = 3', "value", 'is called "temperature"'),
    (BODY + 'kind = "temperature"\ntemperature = [1]', "temperature", "expected a number"),
]
PLANE = '\nobstacle = {kind = "plane", point = [-0.1, 0.0], normal = [1.0, 0.0]}'
CONTACT = '[[contact]]\nname = "c"\nslave = "block.left"'
TURN = '\n[[load]]\nname = "turn"\nkind = "obstacle"\nobstacle = "c"\nrotation = 1.0'
GRIP = '[[load]]\nname = "grip"\nboundary = "block.left"\nkind = "platen"\nux = 0.1\nrotation = '
OTHER = '[[load]]\nname = "more"\nboundary = "block.left"\nkind = "platen"\nuy = 0.0\nrotation = "fixed"\n'
FINITE: list[Row] = [
    ("material.rubber.law='linear'", "material.rubber.law", "finite"),
    ("material.rubber.nu=0.49995", "material.rubber.nu", "incompressible"),
    (("E = 2.6\nnu = 0.3\n", WOOD + THIRD), "material.rubber.law", "isotropic"),
    ("mls.degree=1", "mls.degree", "degree 1"),
    ("mls.scheme='collocation'", "mls.scheme", "collocation"),
    ("adapt.passes=1", "adapt.passes", "refinement"),
    ("solver.method='active-set'", "solver.method", "contact"),
    ("reference.solution='hertz-line'", "reference", "analytical"),
    (f'{GRIP}"free"', "load.grip", "both directions"),
    (f"{GRIP}0.1", "load.grip", "both directions"),
    (f"{GRIP}0.1\n{OTHER}", "load.more.rotation", 'write rotation = 0.0 in load "more"'),
    (f'{CONTACT}{PLANE}\nregularization.law = "hyperbolic"', "contact.c.regularization.law", "hyperbolic"),
    (f'{CONTACT}{PLANE}\nfriction = "bonded"', "contact.c.friction", "bonded"),
    (f'{CONTACT}{PLANE}\n[solver]\nmethod = "newton"', "solver.method", "always exact"),
    (f"{CONTACT}{PLANE}\ngap = 0.1", "contact.c.gap", "gap"),
    (f'{CONTACT}\nmaster = "block.right"', "contact.c", "self-contact"),
    (CONTACT + PLANE + TURN, "load.turn.rotation", "pivot"),
]  # fmt: skip
FOLLOWER = BLOCK + "follows = true\n"
NOT_FINITE = ('strain = "finite"\n', "")
SMALL = [
    (BLOCK, "material.rubber.law", "finite strain"),
    (FOLLOWER, "load.press.follows", "finite strain"),
    (BLOCK + CONTACT + PLANE + TURN, "load.turn.rotation", "finite strain"),
]


def _material(keys: str, plane: str) -> str:
    return PULLED.replace(ISOTROPIC, keys).replace('"stress"', f'"{plane}"')


DRAWN = {"plate": PLATE, "block": WAVY}
ALL: list[tuple[str, Change, str, str]] = [
    *((HERTZ, *row) for row in (*VALUES, *RELATIONS)),
    *((PULLED, *row) for row in PARTS),
    *((WAVY, *row) for row in REGIONS),
    *((BLOCK, *row) for row in FINITE),
    (FOLLOWER, "model.plane='stress'", "load.press.follows", "plane stress"),
    *((text, NOT_FINITE, key, words) for text, key, words in SMALL),
    *((_material(keys, plane), "", f"material.rubber.{key}", words) for keys, plane, key, words in MATERIALS),
    *((PULLED, MORE + keys, f"load.more.{key}".strip("."), words) for keys, key, words in LOADS),
    *(
        (DRAWN[name], f"body.{name}.shape.{a}", f"body.{name}.shape.{b}", words)
        for name, a, b, words in OUTLINES
    ),
]


@pytest.mark.parametrize(("text", "change", "key", "words"), ALL, ids=[f"{row[2]}: {row[3]}" for row in ALL])
def test_a_fault_is_told_with_its_key(text: str, change: Change, key: str, words: str) -> None:
    """A change of a sound case: a text in the place of another, an override, or tables to be appended."""
    overrides: tuple[str, ...] = ()
    if isinstance(change, tuple):
        assert change[0] in text
        text = text.replace(*change, 1)
    elif change.startswith("[") or not change:
        text += change
    else:
        overrides = (change,)
    told = {problem.key: problem for problem in problems(text, overrides)}
    assert key in told, told
    assert words in str(told[key])
    assert told[key].source in ("--set", "case.toml")
    assert (told[key].line > 0) == (told[key].source == "case.toml")


@pytest.mark.parametrize(
    ("text", "overrides"),
    [
        *((_material(keys, "stress"), ()) for keys in (ISOTROPIC + "alpha = 1e-5\n", WOOD, FULL)),
        (_material(WOOD + THIRD + "angle = 30\n", "strain"), ()),
        (BLOCK, ()),
        (FOLLOWER, ()),
        (PLATE, (f"body.0.shape.holes={BOLT}, {{center=[1.8, 1.0], radius=0.3}}]",)),
        (BLOCK + '[[support]]\nboundary = "block.left"\nspring = [1.0, 0.0]\n', ()),
        (BLOCK + CONTACT + PLANE, ()),
        (BLOCK + CONTACT + PLANE, ("solver.method='active-set'",)),
        (BLOCK + CONTACT + PLANE + TURN + "\npivot = [0.0, 0.0]", ()),
        (BLOCK + f'{GRIP}"free"\nfy = 0.0', ()),
        (HERTZ, ("stage=[{press=1.0}, {press=0.0}]", "output.at=[0, 0.5, 2.0]")),
    ],
)
def test_sound_cases(text: str, overrides: tuple[str, ...]) -> None:
    case = parse(text, overrides).case
    again = parse(toml_text(resolved_mapping(case))).case
    assert again == case


@pytest.mark.parametrize("valid", [False, True], ids=["values", "relations"])
def test_problems_are_told_together_in_the_order_of_the_file(valid: bool) -> None:
    """Invalid values, relations between keys, and unknown keys."""
    text, invalid = HERTZ, ('plane = "strain"', "nu = 0.3", "radius = 50.0")
    for old, new in (
        ('plane = "strain"', 'plane = "strains"'),
        ("nu = 0.3", "nu = 0.7"),
        ('material = "steel"', 'material = "stele"'),
        ("radius = 50.0", "radius = 0"),
        ('"block.bottom"', '"block.botom"'),
        ("force = ", "forse = "),
        ('"block.top"', '"blok.top"'),
    ):
        text = text if valid and old in invalid else text.replace(old, new, 1)
    order = [] if valid else ["solver.order=1"]
    told = [(problem.key, problem.line) for problem in problems(text, order)]
    relations = [("support.0.boundary", 39), ("load.press", 43), ("load.press.forse", 47)]
    relations += [("contact.interface.master", 52)]
    # Of a body without a valid shape its other relations are not known.
    values = [("model.plane", 5), ("material.steel.nu", 9), ("body.cylinder.shape.radius", 18)]
    first = [("body.cylinder.material", 13)] if valid else values
    assert told == [*first, *relations, *([] if valid else [("solver.order", 0)])]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (("radius = 1.0", 'radius = 1.0\nradios = 2.0\nalong = "arc"'), "body.cylinder.refine.0.along"),
        (("y = [-100.0, 0.0]", "y = [-100.0, 0.0]\nz = 0\n"), "support.0.boundary"),
        (("uy = 0.0", "uy = 0.0\nuz = 0.0\nnear = [0, 0]"), "support.0"),
        (("force = [", "mass = 1.0\nux = 1.0\nforce = ["), "load.press.ux"),
        (("friction = 0.0", "frictoin = 1\nregularization = {lw = 1, law = 'exact'}"), "solver.method"),
    ],
)
def test_an_unknown_key_hides_no_other_fault(change: tuple[str, str], key: str) -> None:
    text = (HERTZ + 'friction = 0.0\n[solver]\nmethod = "anm"\n').replace(*change, 1)
    changes = ['support.0.boundary="block.tp"'] if key.endswith("boundary") else []
    told = {problem.key: problem.message for problem in problems(text, changes)}
    assert key in told
    assert "unknown key" in told.values()


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ('format = 1\n[model]\nplane = "strain"\n', ["body", "material"]),
        ('format = 1\nbody = 1\n[model]\nplane = "strain"\n', ["body", "material"]),
        (HERTZ.replace("210e3", "-1.0").replace("0.3", "0.6"), ["material.steel.E", "material.steel.nu"]),
        (
            HERTZ.replace("uy = 0.0", "uy = 0.1").replace("radius = 50.0", "radius = 50.0\nsize = 1.0"),
            ["body.cylinder.shape.size", "support.0.uy"],
        ),
        # A contact with a fault still is one for the checks of other keys.
        (HERTZ + 'friction = "some"\n[solver]\nformulation = "monolithic"\n', ["contact.interface.friction"]),
        (HERTZ.replace("block.bottom", "block.botom"), ["support.0.boundary"]),
    ],
)
def test_faults_are_told_once_and_together(text: str, keys: list[str]) -> None:
    assert sorted(problem.key for problem in problems(text)) == keys
