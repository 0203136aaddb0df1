"""Regularised frictional contact in one sparse system of bodies and contact, followed by power series or by
Newton-Raphson: the route of "High order mesh-free method for frictional contact".

    law.py          every inequality of contact and friction as a hyperbola
    collocation.py  the strong form with as many equations as unknowns
    system.py       bodies, contact and friction as one quadratic system R(x, lam) = 0
    path.py         its path along the loads, and the history of friction
"""
