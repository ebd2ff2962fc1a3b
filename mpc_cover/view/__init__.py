"""What a user sees: figures and tables. The only package that imports matplotlib."""
