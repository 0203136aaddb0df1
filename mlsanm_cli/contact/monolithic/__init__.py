"""The whole system at once, without condensation."""
