"""The mission: what a user asks for, read from YAML into frozen models."""
