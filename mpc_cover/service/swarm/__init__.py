"""Agents that need no controller."""
