"""Closed formulas that results are checked against."""
