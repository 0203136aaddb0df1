"""Admissible sets: all violating nodes are exchanged at once; where sets recur, complementary pivoting.

About a state with some sets the conditions of all nodes are a linear complementarity problem w = M z + r,
w >= 0, z >= 0, w z = 0: z are the quantities that vanish in these sets, w their partners. With the slip
s = b - a, a, b >= 0, the pairs of a node are its gap and pressure p, a and mu p - t, b and mu p + t. Under
regularised laws nodes have no gap, and p = p' - p'' is split instead: friction counts for p' only. The path
of one artificial load to the solution passes no basis twice (Lemke 1965, doi:10.1287/mnsc.11.7.681).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.limit_load import slides_freely
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, EndlessError, NoStateError, exchange
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError

MAX_EXCHANGES, MAX_STARTS = 30, 6
"""Exchanges of all violating nodes before pivoting; and number of sets from which it starts."""
MAX_PIVOTS, PIVOTS_PER_NODE = 500, 2
"""Limit of pivots over all starts: MAX_PIVOTS plus PIVOTS_PER_NODE per node. Successful paths took one per
node, with few nodes up to four; without a solution paths may go on for minutes."""
HOLDING_FRICTION = 1e3
"""Coefficient of friction of nodes that must not slip while they open or close."""
PERTURBATION, MIN_PIVOT, TIE = 1e-10, 1e-11, 1e-6
"""Relative perturbation of right-hand sides, so that no two nodes change at once; smallest relative pivot;
and difference of ratios that only the perturbation makes."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def admissible_sets(
    condensed: Condensed,
    first: ContactStatus,
    watch: AdmissibleChanges,
    solve: Callable[[ContactStatus], tuple[SetSystem, ContactSolution, FloatArray]],
    softened: Condensed | None = None,
) -> tuple[ContactStatus, SetSystem, ContactSolution, int]:
    """Sets that satisfy all watched conditions, their system and values, and the number of systems solved.

    ``solve`` returns the system of given sets, the values that the conditions refer to, and the slips (n,)
    that friction must oppose, or raises SingularSystemError. Pivoting starts from the best of the sets that
    exchanges led to. For regularised laws, with gaps everywhere, ``softened`` is the compliance, and open
    nodes are those without friction and with falling pressure, given as a gap. Raises NoStateError.
    """
    sets, last, seen, count, ended = first, first, set[bytes](), 0, False
    starts = list[tuple[int, ContactStatus, ContactSolution, FloatArray]]()
    while sets.key not in seen and count < MAX_EXCHANGES:
        seen.add(sets.key)
        count += 1
        try:
            system, values, slipped = solve(sets)
        except SingularSystemError:
            if starts:
                break
            # A contact that slides as a whole may come to rest.
            last, sets = sets, sets.resting(condensed.friction_nodes)
            continue
        better, wrong = exchange(condensed, sets, watch, values, slipped)
        if not wrong.any():
            return sets, system, values, count
        starts.append((int(wrong.sum()), sets, values, slipped))
        sets = better
    # Starts that stick give way node by node, where those that slide as a whole fail.
    fewest = sorted(starts, key=lambda one: one[0])[:MAX_STARTS]
    tried = [*fewest[:1], *(one for one in starts[:1] if one is not fewest[0]), *fewest[1:]]
    left = MAX_PIVOTS + PIVOTS_PER_NODE * len(first.closed)
    for _, sets, values, slipped in tried:
        last, pivots, found = _pivoted(condensed, sets, watch, values, slipped, left, softened)
        left, count = left - pivots, count + pivots
        if not found:
            if left <= 0:
                break
            continue
        try:
            system, values, slipped = solve(last)
        except SingularSystemError:  # sets that slide as a whole, to within round-off
            continue
        if not exchange(condensed, last, watch, values, slipped)[1].any():
            return last, system, values, count
        ended = True
    if ended:
        raise EndlessError(count)
    raise NoStateError(sliding=slides_freely(condensed, last))


def _pivoted(
    condensed: Condensed,
    sets: ContactStatus,
    watch: AdmissibleChanges,
    values: ContactSolution,
    slipped: FloatArray,
    most: int,
    softened: Condensed | None,
) -> tuple[ContactStatus, int, bool]:
    """Sets by pivoting from others with their ``values``, the number of pivots, and whether they are a
    solution."""
    nodes, closed, smooth = condensed.friction_nodes, sets.closed, softened is not None
    solved, m, n = softened or condensed, len(closed), len(nodes)
    system = SetSystem(solved, replace(sets, closed=np.ones(m, dtype=bool)) if smooth else sets)
    stiff = 1.0 / (condensed.largest_compliance or 1.0)
    pressure = values.pressure - values.gap / condensed.own[0] if smooth else values.pressure
    either = watch.opening & watch.closing
    slips, mu = watch.slipping | either[nodes], np.where(watch.slipping, condensed.friction, HOLDING_FRICTION)
    normal = np.flatnonzero(either)
    ahead, back = np.flatnonzero(slips & (watch.side >= 0.0)), np.flatnonzero(slips & (watch.side <= 0.0))
    # 1 where mu p - t vanishes, -1 where mu p + t does, 0 at sticking nodes.
    sense = np.where(closed[nodes], sets.slip_sign, np.where(slipped > 0.0, -1.0, 1.0))

    def partners(
        p: FloatArray, t: FloatArray, gap: FloatArray, slip: FloatArray, more: FloatArray
    ) -> FloatArray:
        """The quantities w; ``more`` (m + 2n,) are parts of p', a and b besides those of p and slip."""
        whole = np.where(closed | (not smooth), p, 0.0) + more[:m]
        limit, a, b = mu * whole[nodes], more[m : m + n], more[m + n :]
        own = np.where(closed, whole, whole - p if smooth else stiff * gap)
        forward = np.where(sense == 1.0, b - stiff * slip, limit - t)
        backward = np.where(sense == -1.0, a + stiff * slip, limit + t)
        return np.concatenate([own[normal], forward[ahead], backward[back]])

    def response(part: str, at: int) -> FloatArray:
        """Changes of w by a unit of the quantity in z of a node."""
        p, t, gap, slip, more = np.zeros(m), np.zeros(n), np.zeros(m), np.zeros(n), np.zeros(m + 2 * n)
        if part == "normal" and closed[at] and not smooth:
            gap[at] = 1.0 / stiff
        elif part == "normal":
            (more if smooth else p)[at] = 1.0
            t[nodes == at] = (sense * mu)[nodes == at]
        else:
            way = 1.0 if part == "ahead" else -1.0
            if sense[at] == way:
                t[at] = -way
            elif sense[at] == 0.0:
                slip[at] = -way / stiff
            else:
                more[m + at if way > 0.0 else m + n + at] = 1.0
        caused = solved.blocks @ np.concatenate([p, t, np.zeros(len(solved.whole) - m - n)])
        found = system.response(caused[:m] - gap, caused[m : m + n] - slip, caused[m + n :])
        return partners(found.pressure + p, found.traction + t, found.gap + gap, found.slip + slip, more)

    pairs = [("normal", i) for i in normal] + [("ahead", j) for j in ahead] + [("back", j) for j in back]
    matrix = np.array([response(part, int(at)) for part, at in pairs]).reshape(len(pairs), len(pairs)).T
    rest = partners(pressure, values.traction, values.gap, slipped, np.zeros(m + 2 * n))
    uneven = 1.0 + 0.5 * np.mod(GOLDEN * np.arange(len(rest)), 1.0)
    swapped, pivots, found = lemke(matrix, rest, most, np.maximum(-rest, 0.0) * uneven)
    closed, forward, backward = closed.copy(), sense == 1.0, sense == -1.0
    ends = np.cumsum([len(normal), len(ahead)])
    for status, which, swap in zip(
        (closed, forward, backward), (normal, ahead, back), np.split(swapped, ends), strict=True
    ):
        status[which] ^= swap
    sign = np.where(closed[nodes] & watch.slipping, forward.astype(float) - backward, 0.0)
    return ContactStatus(closed, closed[nodes] & (sign == 0.0), sign), pivots, found


def lemke(
    matrix: FloatArray, rest: FloatArray, most: int, load: FloatArray | None = None
) -> tuple[BoolArray, int, bool]:
    """Mask (n,) of the unknowns z in the basis of w = M z + r, w >= 0, z >= 0, w z = 0, the number of pivots,
    at most ``most``, and whether it is a solution. The artificial ``load`` (n,) is even by default."""
    n, count = len(rest), 0
    largest = float(np.abs(rest).max(initial=0.0))
    rest = rest + PERTURBATION * largest * (1.0 + np.mod(GOLDEN * np.arange(n), 1.0))
    basis: IntArray = np.arange(n)
    solution = not (rest < 0.0).any()
    # Columns: w, z, the artificial load, the right-hand side.
    load = np.ones(n) if load is None else load
    table = np.hstack([np.eye(n), -matrix, -load[:, None], rest[:, None]])
    lacking = np.flatnonzero(rest < 0.0)
    enters, row = 2 * n, 0 if solution else int(lacking[np.argmin(rest[lacking] / load[lacking])])
    while not solution and count < most:
        count += 1
        table[row] /= table[row, enters]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, enters], table[row])
        leaves, basis[row] = int(basis[row]), enters
        solution = leaves == 2 * n
        enters = leaves + n if leaves < n else leaves - n
        column = table[:, enters]
        up = np.flatnonzero(column > MIN_PIVOT * max(float(np.abs(column).max()), 1.0))
        if not len(up):
            break
        ratios = np.maximum(table[up, -1], 0.0) / column[up]
        # Where friction vanishes with the load, the load is the first to.
        ends = up[(basis[up] == 2 * n) & (ratios <= (1.0 + TIE) * ratios.min())]
        row = int(ends[0] if len(ends) else up[np.argmin(ratios)])
    found = np.zeros(n, dtype=bool)
    # What grows without bound is part of a mechanism.
    within = basis if solution else np.append(basis, enters)
    found[within[(within >= n) & (within < 2 * n)] - n] = True
    return found, count, solution
