"""From condensed scenes to paths: contact grids, coercivity, states, and the methods that follow loads."""
