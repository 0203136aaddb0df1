"""Files: run.h5, VTU, JSON, CSV, TOML and pictures. Arrays and mappings in, files out, no physics."""
