"""First guesses of a motion: each module yields trajectories that the optimiser starts from."""
