"""Gases in equilibrium and in steady states."""
