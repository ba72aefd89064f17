"""Read output files, determine the traits of runs, and convert runs to other types."""
