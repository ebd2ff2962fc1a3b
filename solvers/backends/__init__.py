"""QP back-ends behind one interface; `registry.make_backend` imports them by name, only when asked for."""
