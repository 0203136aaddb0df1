"""Load paths of condensed scenes: contact grids, coercivity, states, and path-following methods."""
