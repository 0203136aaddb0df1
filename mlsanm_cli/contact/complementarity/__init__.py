"""The contact problem with Coulomb friction as one mixed linear complementarity problem."""
