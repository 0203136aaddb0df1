"""Frictional contact by the route of "High order mesh-free method for frictional contact": strong form, virtual
nodes, regularised laws, power series along the loads or Newton-Raphson on the same equations.

The unknowns x = (u, h, a, b, p, t, q) are the displacements of all bodies; gaps, plastic slips in both
directions, pressures and tractions of the contact; and the motions of platens. The equations, row by row, for
load factors f and stick references r::

    u  bodies    K u - F(f, q, p, t)                 = 0
    h  gap       h - h0 - N u - A_n (p, t)           = 0
    a  friction  a (mu (p + eta) - t) - eps          = 0
    b            b (mu (p + eta) + t) - eps          = 0
    p  contact   (p + eta) h - eta delta             = 0
    t  slip      T u + A_t (p, t) + c t + a - b - r  = 0
    q  platens   forces(f, q, p, t)                  = 0

K is the strong form by moving least squares, solved in the sense of least squares or by collocation. N u and T u
are motions of the slave's nodes relative to virtual nodes of the master, which move by its moving least-squares
values; A (p, t) corrects waves too short for the clouds.

Every inequality is a hyperbola. Signorini's conditions are p >= 0, h >= 0, p h = 0; Coulomb's law says the same
of each plastic slip and the margin of the traction to that side of the cone. The products get small constant
values instead of zero. A sticking node is a spring of compliance c about r, a slipping one carries t = +-mu p,
both up to terms of relative size eta, without a corner between them. From time to time r follows the plastic slips:
backward Euler's integration of Coulomb's law, a return mapping with a smooth corner.

All equations are quadratic, R(x, lam) = C(lam) + M x + Q(x, x) = 0. Order k of a power series about x_0 solves ::

    (M + 2 Q(x_0, .)) x_k = -C_k - sum of Q(x_j, x_{k-j}) over 0 < j < k,

with the tangent of Newton-Raphson, one sparse matrix.

Sources: B. Cochelin, Computers & Structures 53 (1994) 1181; A. Elhage-Hussein, M. Potier-Ferry, N. Damil,
International Journal of Solids and Structures 37 (2000) 6981, the hyperbola of contact; P. Wriggers, Computational
Contact Mechanics (2006), section 5.2, friction as elastoplasticity. Equations (13) to (16) of docs/method.md.
"""
