"""What a run writes: rows of run.h5, fields, summary, VTU."""
