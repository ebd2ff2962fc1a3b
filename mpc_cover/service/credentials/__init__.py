"""Who may speak: keys and certificates of a fleet, access control, and signed messages."""
