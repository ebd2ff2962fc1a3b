"""The subproblem, the guesses, the planner and the plan."""
