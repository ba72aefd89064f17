"""Exchange of files with other programs."""
