"""Motion, sensing, disturbance and braking models (thesis 3.1, 3.2, 4.2)."""
