"""Analysis of runs: means with errors, correlations, structure, fields and transport."""
