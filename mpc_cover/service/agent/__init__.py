"""The agent daemon: it flies the newest plan that passes its filter, also when its controller is gone."""
