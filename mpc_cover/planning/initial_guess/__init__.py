"""Initial guesses for trajectory optimisation: each module yields motions from which the solver starts."""
