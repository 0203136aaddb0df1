"""Moving least squares: stencils on a cloud, sparse rows made of them, least-squares systems."""
