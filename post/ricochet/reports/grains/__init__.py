"""Granular matter: cooling, craters and flows."""
