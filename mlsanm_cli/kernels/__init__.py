"""Compiled loops: flat arrays in, flat arrays out. The only place that imports numba."""
