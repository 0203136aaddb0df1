"""Reading of TOML text into a case, with errors located by line."""
