"""Comparing the methods of solution on the same operators."""
