"""Contact between bodies: pairs of surfaces, condensed compliance, contact laws."""
