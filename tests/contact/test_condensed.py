"""The condensed problem against whole solutions, and what its certificate and balances catch."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.coercivity import contact_stability, relative_resistance
from mlsanm_cli.contact.response.nodal import slip_fit
from tests.contact.scenes import Small, cylinder

PRESSED = "uy = -0.01\nux = 0.003"


SWAPPED = ('contact.interface.slave="block.top"', 'contact.interface.master="cylinder.arc"')


@pytest.fixture(scope="module", params=[(), SWAPPED], ids=["arc on flat", "flat on arc"])
def pushed(request: pytest.FixtureRequest) -> Small:
    """A half-disk pushed down, and a little aside, by a platen that moves."""
    return cylinder(0.012, *request.param, control=PRESSED)


@pytest.fixture(scope="module")
def forced() -> Small:
    """The same under a force."""
    return cylinder(0.012)


def whole_solution(
    small: Small, pressure: FloatArray, traction: FloatArray | None = None
) -> dict[str, FloatArray]:
    """Displacements (n, 2) of both bodies at full load, with right-hand sides of its own."""
    pairing = small.pairing
    shear = np.zeros(len(pressure)) if traction is None else traction
    fields = {}
    for name, body in small.scene.bodies.items():
        cloud = body.model.cloud
        rhs = np.zeros(body.rows)
        if name == "cylinder":
            flat = np.tile([0.003, -0.01], (len(cloud.surfaces["flat"].index), 1))
            rhs += body.source("flat", flat, held=True)
        if name == pairing.slave_body:
            values = np.zeros((len(pairing.slave.index), 2))
            at = pairing.position[pairing.candidate]
            n_x, n_y = pairing.normal[pairing.candidate].T
            values[at, 0] = pressure * n_x + shear * n_y
            values[at, 1] = pressure * n_y - shear * n_x
            rhs += body.source(pairing.slave.name, values, held=False)
        else:
            # The opposite of what the slave's pieces receive is tested with the sources.
            tangential = shear if len(small.condensed.friction_nodes) else np.zeros(0)
            unknowns = np.zeros(1), np.zeros(0), pressure, tangential
            rhs += small.condensed.source(name, *unknowns).toarray()[:, 0]
        fields[name] = body.system.solve(sparse.csc_array(rhs[:, None])).reshape(-1, 2)
    return fields


def apart(small: Small, fields: dict[str, FloatArray]) -> FloatArray:
    """Displacements (m, 2) of the candidates less those of their partners, short waves and all."""
    pairing = small.pairing
    chosen = pairing.candidate
    assert pairing.master_body is not None
    model, at = small.scene.bodies[pairing.master_body].model, pairing.partner[chosen]
    on_x, on_y = (model.values_along(at, np.tile(axis, (len(at), 1))) for axis in np.eye(2))
    u = fields[pairing.master_body].ravel()
    slave = fields[pairing.slave_body][pairing.node[chosen]]
    return np.asarray(slave - np.stack([on_x @ u, on_y @ u], axis=1))


def slips(small: Small, fields: dict[str, FloatArray]) -> FloatArray:
    """Slips (m,) of the candidates from nodal displacements."""
    x, y = apart(small, fields).T
    n_x, n_y = small.pairing.normal[small.pairing.candidate].T
    return np.asarray(x * n_y - y * n_x)


def gaps(small: Small, fields: dict[str, FloatArray]) -> FloatArray:
    """Gaps (m,) of the candidates from nodal displacements."""
    pairing, chosen = small.pairing, small.pairing.candidate
    return np.asarray(pairing.gap[chosen] + (apart(small, fields) * pairing.normal[chosen]).sum(axis=1))


def test_displacements_are_those_of_whole_solutions(pushed: Small) -> None:
    state = pushed.exact()
    expected = whole_solution(pushed, state.pressure)
    for body in pushed.scene.bodies:
        got = pushed.displacement(body, state)
        assert np.abs(got - expected[body]).max() <= 1e-9 * np.abs(expected[body]).max()
    closed = gaps(pushed, expected)[state.closed]
    assert len(closed) > 3
    assert np.abs(closed).max() <= 1e-9 * 0.01


@pytest.fixture(scope="module", params=[(), SWAPPED], ids=["arc on flat", "flat on arc"])
def frictional(request: pytest.FixtureRequest) -> Small:
    """The pushed half-disk with friction."""
    return cylinder(0.012, *request.param, "contact.interface.friction=0.3", control=PRESSED)


def test_gaps_and_slips_with_friction_are_those_of_whole_solutions(frictional: Small) -> None:
    c, pairing = frictional.condensed, frictional.pairing
    arc = pairing.arc[pairing.candidate]
    fit = slip_fit(pairing)
    rng = np.random.default_rng(1)
    for pressure in (np.zeros(len(arc)), rng.uniform(0.0, 100.0, len(arc))):
        traction = 50.0 + 400.0 * (arc - arc.mean())
        fields = whole_solution(frictional, pressure, traction)
        got = c.gap(np.ones(1), np.zeros(0), pressure, traction)
        assert np.abs(got - gaps(frictional, fields)).max() <= 1e-9 * np.abs(got).max()
        found = c.slip(np.ones(1), np.zeros(0), pressure, traction)
        # Linear tractions cause slips that are fitted like those of fitted pressures and loads.
        expected = fit @ slips(frictional, whole_solution(frictional, fit @ pressure, traction))
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def imbalances(small: Small, *unknowns: FloatArray) -> FloatArray:
    """Sum of all forces on every body (2 per body)."""
    return np.concatenate([one(*unknowns) for one in small.condensed.quantities["imbalance"].values()])


def test_tractions_enter_the_forces(frictional: Small) -> None:
    c, pairing = frictional.condensed, frictional.pairing
    count, nothing = len(c.weight), np.zeros(len(c.weight))
    t = np.full(count, 7.0)
    force = c.quantities["contact"]["interface"](np.zeros(1), np.zeros(0), nothing, t)
    n_x, n_y = pairing.normal[pairing.candidate].T
    expected = [(7.0 * c.weight) @ n_y, -(7.0 * c.weight) @ n_x]
    assert force == pytest.approx(expected, rel=1e-4, abs=1e-6 * np.abs(expected).max())
    # The platen carries what the contact does to its body; the other body's support takes the reaction.
    on_cylinder = force if pairing.slave_body == "cylinder" else -force
    assert c.quantities["force"]["press"](np.zeros(1), np.zeros(0), nothing, t) == pytest.approx(
        -on_cylinder, rel=1e-9
    )
    imbalance = imbalances(frictional, np.zeros(1), np.zeros(0), nothing, t)
    assert np.abs(imbalance).max() <= 0.05 * np.abs(force).max()


def test_forces_are_those_of_the_pressures(forced: Small) -> None:
    c, state, pairing = forced.condensed, forced.exact(), forced.pairing
    arguments = (state.factors, state.motion, state.pressure)
    contact = c.quantities["contact"]["interface"](*arguments)
    # Pressures are linear along the arc, not lumped at the nodes.
    lumped = (c.weight * state.pressure) @ pairing.normal[pairing.candidate]
    assert contact == pytest.approx(lumped, rel=2e-5, abs=1e-4)
    assert contact == pytest.approx([0.0, 226.566], abs=1e-6)
    assert c.quantities["force"]["press"](*arguments) == pytest.approx(-contact, abs=1e-7)
    assert np.abs(imbalances(forced, *arguments)).max() <= 1e-9 * 226.566
    # The block's own loss stays small.
    assert c.quantities["force"]["block.bottom"](*arguments)[1] == pytest.approx(226.566, rel=0.03)


def test_force_and_displacement_control_meet(forced: Small) -> None:
    state = forced.exact()
    down = float(state.motion[0])
    same = cylinder(0.012, control=f"uy = {down!r}\nux = 0.0").exact()
    assert np.abs(same.pressure - state.pressure).max() <= 1e-8 * state.pressure.max()
    assert np.array_equal(same.closed, state.closed)


def test_certificate_is_positive_for_facing_clouds(forced: Small) -> None:
    # Scale-free: the same for a finer cloud.
    for small in (forced, cylinder(0.004)):
        assert contact_stability(small.condensed, small.exact().closed) >= 0.9


@pytest.mark.parametrize("nodes", [16, 64])
def test_certificate_of_the_half_plane_itself_is_one(nodes: int) -> None:
    # Waves on a periodic surface: the compliance is 2 / (E* k), k the wave number.
    k = 2.0 * np.pi * np.abs(np.fft.fftfreq(nodes, 1.0 / nodes))
    symbol = np.where(k > 0.0, 2.0 / (3.0 * np.where(k > 0.0, k, 1.0)), 1.0)
    compliance = np.real(np.fft.ifft(symbol[:, None] * np.fft.fft(np.eye(nodes), axis=0), axis=0))
    value = relative_resistance(np.full(nodes, 1.0 / nodes), np.eye(nodes) / 3.0, compliance)
    assert value == pytest.approx(1.0)


def test_nodes_left_out_are_watched(forced: Small) -> None:
    pairing = forced.pairing
    assert 0 < pairing.candidate.sum() < len(pairing.candidate)
    watched = forced.condensed.watched
    assert watched.constant == pytest.approx(pairing.gap[~pairing.candidate])
    state = forced.exact()
    assert (watched(state.factors, state.motion, state.pressure) > 0.0).all()
    assert forced.condensed.gap.constant == pytest.approx(pairing.gap[pairing.candidate])


@pytest.mark.parametrize(("softest", "expected"), [(-40.0, 0.8), (0.02, 0.02), (-0.02, 0.02)])
def test_a_body_that_sways_under_dead_pressures_resists_those_of_contacts(
    softest: float, expected: float
) -> None:
    """A compliance with one eigenvalue that is large and negative, as beyond a column's critical load, and
    one with an eigenvalue near zero."""
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(5, 5)))[0]
    compliance = rotation @ np.diag([softest, 0.8, 0.9, 1.0, 5.0]) @ rotation.T * 2.0 / np.pi
    value = relative_resistance(np.ones(5), np.eye(5), compliance, constrained=True)
    assert value == pytest.approx(expected)
