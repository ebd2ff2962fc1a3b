"""The peers of the planner's benchmark, one per file: ours with each back-end, and general-purpose solvers."""
