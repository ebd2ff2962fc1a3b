"""Those who solve the same problem, one a file: ours with each back-end, and general-purpose solvers."""
