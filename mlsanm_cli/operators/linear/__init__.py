"""Sparse symmetric positive definite systems behind one small interface."""
