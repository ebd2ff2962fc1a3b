"""QP back-ends and a globalised SQP method, independent of the application."""
