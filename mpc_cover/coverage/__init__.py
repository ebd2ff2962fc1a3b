"""Nearest samples, the objective (4.34) and its convex majoriser."""
