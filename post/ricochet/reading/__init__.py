"""Modules that read output files, determine traits of runs, and convert runs to other types."""
