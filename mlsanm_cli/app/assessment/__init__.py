"""How far a result can be believed: error estimates, balances, overlaps, refinement."""
