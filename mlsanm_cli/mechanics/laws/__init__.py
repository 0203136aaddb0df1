"""Constitutive laws, each of which states its energy or its stress once as power series."""
