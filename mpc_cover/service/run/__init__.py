"""Ways to run the service: daemons, demo, simulation, and the records that they write."""
