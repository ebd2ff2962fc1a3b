"""The controller daemon: listen, predict, control law, optimise, filter, publish."""
