"""The agent daemon: it flies the newest plan that passes its filter, and outlives its controller."""
