"""Convex approximations of the constraints around an iterate, one constraint per module, as rows of a QP."""
