"""Read output files, and determine the traits of runs."""
