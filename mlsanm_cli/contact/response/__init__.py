"""How bodies respond to contact tractions: near field, remainder, condensation."""
