"""Many runs: any fields of a scenario as axes, on one machine or many."""
