"""The comparative study, reproduced: its experiments, and each of its claims with measurements and a verdict."""
