"""Ahead-of-time compilation of kernels, storage of their machine code, and calls."""
