"""Trajectories of few disks: scattering, chaos and diffusion of a tracer."""
