"""The daemon, the agents and their protocol."""
