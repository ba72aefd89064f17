"""Output files: their layout, what kind of run one is, and runs for other programs."""
