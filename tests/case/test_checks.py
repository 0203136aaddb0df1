"""Relations between the parts of a case."""

from __future__ import annotations

import pytest

from tests.case.scenes import CLAMP, HERTZ, PULL, SQUARE, only, parse, problems

POINT = '[[support]]\nbody = "square"\nnear = [1, 0]\nuy = 0\n'


def load(name: str, boundary: str, kind: str, keys: str) -> str:
    return f'[[load]]\nname = "{name}"\nboundary = "square.{boundary}"\nkind = "{kind}"\n{keys}\n'


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        (('material = "steel"', 'material = "steal"'), "body.cylinder.material", 'did you mean "steel"'),
        (('name = "block"', 'name = "cylinder"'), "body.cylinder.name", "already"),
        (("nu = 0.3", "nu = 0.5"), "material.steel.nu", "plane strain"),
        (("nu = 0.3", "nu = -1.0"), "material.steel.nu", "greater than -1"),
        (("nu = 0.3", "nu = 0.51"), "material.steel.nu", "at most 0.5"),
        (('"block.top"', '"block.tpo"'), "contact.interface.master", 'did you mean "block.top"'),
        (('"block.top"', '"blocks.top"'), "contact.interface.master", 'did you mean "block"'),
        (('"block.top"', '"top"'), "contact.interface.master", "<body>.<boundary>"),
        (('"cylinder.flat"', '"cylinder.top"'), "load.press.boundary", "no boundary"),
        (('along = "top"', 'along = "cylinder.arc"'), "body.block.refine.0.along", "boundaries: "),
        (('along = "top"', 'along = "block.tpo"'), "body.block.refine.0.along", 'did you mean "top"'),
        (("x = [-100.0, 100.0]", "x = [100.0, -100.0]"), "body.block.shape.x", "not a range"),
        (("spacing = 4.0", "spacing = 101.0"), "body.cylinder.spacing", "larger than the body"),
        (("x = [-100.0, 100.0]", "x = [1.0, 1.0]"), "body.block.shape.x", "not a range"),
        (("spacing = 0.02", "spacing = 5.0"), "body.cylinder.refine.0.spacing", "larger than the body's"),
        (("at = [0.0, 0.0]\n", ""), "body.cylinder.refine.0", "exactly one"),
        (("at = [0.0, 0.0]", 'at = [0.0, 0.0]\nalong = "arc"'), "body.cylinder.refine.0", "exactly one"),
        (('"block.top"', '"cylinder.arc"'), "contact.interface.master", "same boundary"),
        (('"block.top"', '"cylinder.flat"'), "contact.interface", "not supported yet"),
        (('"block.top"', '"block.bottom"'), "contact.interface.master", "a support acts on"),
        (('"cylinder.arc"', '"cylinder.flat"'), "contact.interface.slave", 'load "press"'),
        (("ux = 0.0\nuy = 0.0\n", ""), "support.0", "fixes nothing"),
        (("force = [0.0, -350.0]\n", ""), "load.press", "needs a direction"),
        (("force = [", "displacement = [0.0, 1.0]\nforce = ["), "load.press", "both force and displacement"),
        (("force = [", "uy = 1.0\nforce = ["), "load.press.uy", '"force" gives both'),
        (("force = [", "fx = 1.0\ndisplacement = ["), "load.press.fx", '"displacement" gives both'),
        (("force = [0.0, -350.0]", "ux = 0.0\nfx = 1.0"), "load.press.fx", "ux is given"),
    ],
)
def test_wrong_relations(change: tuple[str, str], key: str, words: str) -> None:
    text = HERTZ.replace(*change, 1)
    assert text != HERTZ
    found = [problem for problem in problems(text) if problem.key == key]
    assert found, problems(text)
    assert found[0].line > 0
    assert words in str(found[0])


def test_a_refinement_names_its_boundary_with_or_without_the_body() -> None:
    for name in ("top", "block.top"):
        refine = parse(HERTZ.replace('along = "top"', f'along = "{name}"')).case.body[1].refine[0]
        assert (refine.along, refine.edge("block")) == (name, "top")


MORE = load("more", "right", "pressure", "pressure = 1")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (HERTZ + "[material.gum]\nE = 1\nnu = 0\n", "material.gum"),
        (SQUARE + CLAMP + PULL + MORE + "[[stage]]\npull=1", "load.more"),
        (SQUARE + CLAMP + load("a", "rigth", "pressure", "pressure = 1"), "load.a.boundary"),
        (SQUARE + CLAMP + PULL + '[[support]]\nboundary = "square.left"\nuy = 0\n', "support.1"),
        (SQUARE + CLAMP + PULL + 2 * POINT, "support.2"),
        # A contact with a fault still is one for the checks of other keys.
        (HERTZ + 'friction = "some"\n[solver]\nformulation = "monolithic"\n', "contact.interface.friction"),
    ],
)
def test_only_problem(text: str, key: str) -> None:
    assert only(text).key == key


@pytest.mark.parametrize(
    ("stages", "key", "words"),
    [
        ("[[stage]]\npres = 1.0\npress = 1.0", "stage.0.pres", 'did you mean "press"'),
        ("[[stage]]\n[[stage]]\npress = 1.0", "stage.0", "loads: press"),
        ("[[stage]]\npress = nan", "stage.0.press", "nan and inf"),
        ("[[stage]]\npress = 1.0\n[output]\nat = [0.0, 1.0, 1.01]", "output.at.2", "from 0 to 1"),
        ("[output]\nat = [-0.1]", "output.at.0", "from 0 to 1"),
        ('[output]\nfields = ["stress", "stress"]', "output.fields", "2 times"),
        ("[mls]\ndegree = 4\nneighbors = 14", "mls.neighbors", "15 terms"),
        ('[solver]\nlinear = "mumps"', "solver.linear", "valid: auto, superlu"),
    ],
)
def test_stages_and_numbers(stages: str, key: str, words: str) -> None:
    problem = only(HERTZ + stages)
    assert problem.key == key
    assert words in str(problem)


def test_positions_reach_to_the_last_stage() -> None:
    text = HERTZ + "[[stage]]\npress = 1.0\n[[stage]]\npress = 0.0\n[output]\nat = [0, 0.5, 2.0]"
    assert parse(text).case.output.at == (0.0, 0.5, 2.0)


@pytest.mark.parametrize(
    ("first", "second", "clash"),
    [
        (("traction", "traction = [1, 0]"), ("traction", "traction = [2, 0]"), False),
        (("traction", "traction = [1, 0]"), ("pressure", "pressure = 1"), False),
        (("traction", "traction = [1, 0]"), ("displacement", "displacement = [1, 0]"), True),
        (("pressure", "pressure = 1"), ("platen", "ux = 1"), True),
        (("pressure", "pressure = 1"), ("platen", "uy = 1"), False),
        (("platen", "force = [1, 0]"), ("platen", "force = [0, 1]"), False),
        (("platen", "ux = 1"), ("platen", "ux = 2"), False),
        (("platen", "ux = 1"), ("platen", "fy = 2"), False),
        (("platen", "ux = 1"), ("platen", "fx = 2"), True),
        (("platen", "ux = 1"), ("platen", 'ux = 1\nrotation = "free"'), False),
        (("platen", 'ux = 1\nrotation = "fixed"'), ("platen", "ux = 1\nmoment = 1"), True),
        (("platen", "ux = 1"), ("platen", "ux = 1\nhinge = [1, 2]\nrotation = 0.1"), False),
        (("displacement", "displacement = [1, 0]"), ("platen", "ux = 1"), True),
        (("displacement", "displacement = [1, 0]"), ("displacement", "displacement = [0, 1]"), False),
    ],
)
def test_two_loads_on_one_boundary(first: tuple[str, str], second: tuple[str, str], clash: bool) -> None:
    text = SQUARE + CLAMP + load("a", "right", *first) + load("b", "right", *second)
    if clash:
        assert only(text).key in ("load.b", "load.b.rotation")
    else:
        parse(text)


@pytest.mark.parametrize(
    ("edge", "kind", "keys", "clash"),
    [
        ("left", "traction", "traction = [1, 0]", True),
        ("left", "displacement", "displacement = [1, 0]", True),
        ("left", "platen", "uy = 1", True),
        ("left", "pressure", "pressure = 1", True),
        ("bottom", "pressure", "pressure = 1", True),
        ("bottom", "traction", "traction = [1, 0]", False),
        ("bottom", "traction", "traction = [0, 1]", True),
        ("bottom", "displacement", "displacement = [1, 0]", True),
        ("bottom", "platen", "fx = 1", False),
    ],
)
def test_a_load_on_a_support(edge: str, kind: str, keys: str, clash: bool) -> None:
    text = SQUARE + CLAMP + '[[support]]\nboundary = "square.bottom"\nuy = 0\n' + load("a", edge, kind, keys)
    if clash:
        problem = only(text)
        assert problem.key == "load.a"
        assert "both act on" in problem.message
    else:
        parse(text)


def test_two_supports_of_one_point() -> None:
    parse(SQUARE + CLAMP + PULL + POINT)
    parse(SQUARE + CLAMP + PULL + POINT + POINT.replace("uy", "ux"))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('body = "square"\nux = 0', "near"),
        ("near = [0, 0]\nux = 0", "near"),
        ('boundary = "square.right"\nnear = [0, 0]\nux = 0', "either"),
        ("ux = 0", "near"),
        ('body = "sqare"\nnear = [0, 0]\nux = 0', 'did you mean "square"'),
    ],
)
def test_where_a_support_is(keys: str, words: str) -> None:
    problem = only(SQUARE + CLAMP + PULL.replace("right", "top") + f"[[support]]\n{keys}\n")
    assert problem.key.startswith("support.1")
    assert words in str(problem)


CONTACT = '[[contact]]\nname = "{}"\nslave = "{}"\nmaster = "{}"\n'


def test_boundaries_in_two_contacts() -> None:
    third = HERTZ.replace('name = "press"', 'name = "press"').replace(
        "[[support]]",
        '[[body]]\nname = "third"\nmaterial = "steel"\nspacing = 4.0\n'
        'shape = {kind = "rectangle", x = [-1, 1], y = [0, 5]}\n'
        '[[support]]\nboundary = "third.top"\nux = 0.0\nuy = 0.0\n[[support]]',
    )
    parse(third + CONTACT.format("second", "third.bottom", "block.top"))
    parse(third + CONTACT.format("second", "cylinder.arc", "third.bottom"))
    mirrored = only(third + CONTACT.format("second", "block.top", "cylinder.arc"))
    assert mirrored.key == "contact.second"
    mixed = CONTACT.format("second", "third.bottom", "block.top") + 'regularization.law = "exact"\n'
    eta = "contact.interface.regularization.eta=1e-5"
    assert only(third + mixed, (eta,)).key == "contact.second.regularization.law"


@pytest.mark.parametrize(
    ("method", "law", "fits"),
    [
        ("auto", "hyperbolic", True),
        ("auto", "exact", True),
        ("anm", "hyperbolic", True),
        ("active-set", "exact", True),
        ("newton", "hyperbolic", True),
        ("anm", "exact", False),
        ("newton", "exact", False),
        ("active-set", "hyperbolic", False),
    ],
)
def test_method_and_law(method: str, law: str, fits: bool) -> None:
    settings = [f'solver.method="{method}"', f'contact.interface.regularization.law="{law}"']
    if fits:
        parse(HERTZ, settings)
    else:
        assert only(HERTZ, settings).key == "solver.method"


def test_monolithic_is_for_smooth_contact_laws() -> None:
    chosen = 'solver.formulation="monolithic"'
    assert parse(HERTZ, [chosen]).case.solver.formulation == "monolithic"
    problem = only(HERTZ, [chosen, 'contact.interface.regularization.law="exact"'])
    assert problem.key == "solver.formulation"
    assert 'formulation = "condensed"' in problem.hint


def test_other_faults_are_reported_beside_a_refusal() -> None:
    found = problems(HERTZ, ["support.0.uy=0.1", "body.block.spacing=-1"])
    assert {problem.key for problem in found} == {"support.0.uy", "body.block.spacing"}
    assert any("not supported yet" in problem.message for problem in found)
