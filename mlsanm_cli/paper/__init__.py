"""The route of "High order mesh-free method for frictional contact": strong form, virtual nodes, regularised
laws, and power series along the loads or Newton-Raphson on the same equations.

The unknowns x = (u, h, a, b, p, t, q) are displacements of the bodies; gaps, plastic slips to either side,
pressures and tractions of the contact; and motions of platens. Their equations for load factors f are::

    u  bodies    K u - F(f, q, p, t)                 = 0
    h  gap       h - h0 - N u - A_n (p, t)           = 0
    a  friction  a (mu (p + eta) - t) - eps          = 0
    b            b (mu (p + eta) + t) - eps          = 0
    p  contact   (p + eta) h - eta delta             = 0
    t  slip      T u + A_t (p, t) + c t + a - b - r  = 0
    q  platens   forces(f, q, p, t)                  = 0

K is the strong form by moving least squares, solved by least squares or collocation. N u and T u are the
motions of the slave's nodes relative to virtual nodes of the master, which move by its moving least-squares
values; A corrects waves too short for the clouds.

Every inequality is a hyperbola. Signorini's conditions are p >= 0, h >= 0, p h = 0; Coulomb's law says the
same of the slip to either side and the margin of the traction there. These products get small values instead
of zero: a sticking node is a spring of compliance c about its stick reference r, a slipping one carries
t = +-mu p, both up to terms of relative size eta and without a corner between them. In increments of the
loads r follows the plastic slips: backward Euler's integration of Coulomb's law.

So R(x, lam) = C(lam) + M x + Q(x, x) = 0. Order k of a series about x_0 solves, with the tangent of
Newton-Raphson, (M + 2 Q(x_0, .)) x_k = -C_k - sum of Q(x_j, x_{k-j}) over 0 < j < k.

Sources: B. Cochelin, Computers & Structures 53 (1994) 1181; A. Elhage-Hussein, M. Potier-Ferry, N. Damil,
Int. J. Solids Structures 37 (2000) 6981, contact; P. Wriggers, Computational Contact Mechanics (2006),
section 5.2, friction as elastoplasticity. Equations (13) to (15) of docs/method.md.
"""
