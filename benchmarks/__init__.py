"""How fast headway is, and how well it agrees with others. `python -m benchmarks` runs all of it."""
