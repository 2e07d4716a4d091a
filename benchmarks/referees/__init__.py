"""Other simulators, each run by a Python of its own: nothing in here imports headway."""
