"""From TOML text to a case, with faults located."""
