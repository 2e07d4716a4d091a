"""Linear theory of platoons with delays: transfer functions, roots, verdicts, critical values, responses, maps."""

from headway.environment import check_compiler

check_compiler(needed=False)  # before anything here imports the compiler
