"""Plane elasticity on a cloud: material, equilibrium and boundary rows, platens."""
