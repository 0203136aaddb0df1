"""How kernels are compiled ahead of time, kept, and called as machine code."""
