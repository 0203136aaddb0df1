"""Surfaces that face each other: pairs, contact grids, obstacles."""
