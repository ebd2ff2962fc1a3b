"""The distributed potential law of chapters 5 and 6: each agent decides by itself."""
