"""Closed formulae that results are checked against."""
