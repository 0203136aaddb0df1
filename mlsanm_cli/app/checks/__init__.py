"""How reliable a result is: error estimates, balances, overlaps, refinement."""
