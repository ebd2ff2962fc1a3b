"""The receding horizon and what it falls back to."""
