"""Tests of the continuation layer."""
