"""Reading finished runs: tables, probes, plots, reports."""
