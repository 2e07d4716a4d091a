"""What theory and trajectories say."""

from headway.environment import check_compiler

check_compiler(needed=False)  # before anything here imports the compiler
