"""The receding-horizon control law, its recovery modes and fallback, and the safety filter behind it."""
