"""Deterministic simulation of faults: controller, agents, network, clocks and disk in one process, on virtual time."""
