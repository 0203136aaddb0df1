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
motions of the slave's nodes relative to virtual nodes of the master; A corrects waves too short for the
clouds. The hyperbolas give the products of Signorini's and Coulomb's conditions small values instead of zero;
in increments of the loads r follows the plastic slips, by backward Euler's rule. All is quadratic, R(x, lam)
= C(lam) + M x + Q(x, x).

Sources: B. Cochelin, Computers & Structures 53 (1994) 1181; A. Elhage-Hussein, M. Potier-Ferry, N. Damil,
Int. J. Solids Structures 37 (2000) 6981; P. Wriggers, Computational Contact Mechanics (2006), section 5.2.
Equations (13) to (15) of docs/method.md."""
