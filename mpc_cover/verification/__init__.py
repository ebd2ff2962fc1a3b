"""The independent verifier: shares no code with planning or solvers."""
