"""Figures and tables for users. The only package that imports matplotlib."""
