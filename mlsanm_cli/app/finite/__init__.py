"""Runs at finite strain: from a case to its path, its files and its comparison of methods."""
