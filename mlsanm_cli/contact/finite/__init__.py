"""Contact of bodies at finite strain."""
