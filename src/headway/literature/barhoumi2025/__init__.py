"""The comparative study, reproduced: its experiments, and each of its claims with what was measured and a verdict."""
