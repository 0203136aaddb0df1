"""Bodies at finite strain: hyperelastic laws, rows of the reference cloud, series through both."""
