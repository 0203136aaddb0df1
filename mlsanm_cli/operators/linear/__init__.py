"""Direct solvers for sparse symmetric definite systems behind one interface."""
