"""The independent verifier: shares no code with planner, controller or solvers."""
