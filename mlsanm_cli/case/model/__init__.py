"""The data model of a case file."""
