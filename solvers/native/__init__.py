"""Compiled kernels: the interior point that knows the structure of the coverage problem."""
