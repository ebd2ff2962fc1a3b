"""The coverage objective (4.34), its convex majoriser, and the nearest-sample search that both use."""
