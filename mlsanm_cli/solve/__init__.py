"""Load paths of condensed scenes: contact grids, states, and path-following methods."""
