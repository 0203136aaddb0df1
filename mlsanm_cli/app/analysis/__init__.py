"""Analyses at small and at finite strain."""
