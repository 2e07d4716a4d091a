"""What theory and trajectories say."""
