"""Constitutive laws: one file each, which states its energy or its stress once as power series."""
