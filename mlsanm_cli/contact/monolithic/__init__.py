"""Monolithic solution: the whole system at once, without condensation."""
