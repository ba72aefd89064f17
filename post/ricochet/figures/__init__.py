"""Figures and films of disks and walls."""
