"""Checks of the relations between the parts of a case."""
