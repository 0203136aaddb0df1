"""Node clouds: outlines of named curves, node spacing, boundary and interior nodes, quality figures."""
