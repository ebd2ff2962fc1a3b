"""What is still owed: residual information of the cells (thesis 5.2.1)."""
