"""Node clouds: outlines made of named curves, node spacing, boundary nodes, interior nodes, quality figures."""
