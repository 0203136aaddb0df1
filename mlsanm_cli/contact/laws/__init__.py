"""Unilateral contact and Coulomb friction, exact and regularised."""
