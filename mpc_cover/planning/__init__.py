"""Trajectory optimisation: the OCP, its convex subproblem, initial guesses, the SCP solver, and searches over them."""
