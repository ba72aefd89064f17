"""Output files: reading runs, their physical properties, and conversion for other programs."""
