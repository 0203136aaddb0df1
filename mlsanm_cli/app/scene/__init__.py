"""From a validated case to the scene that is solved: clouds, pairs, conditions, loads, contact ranges."""
