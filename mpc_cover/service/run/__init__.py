"""Ways to run: daemons, demo, simulation, and the records that they leave."""
