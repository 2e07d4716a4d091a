"""Integrates scenarios."""

from headway.environment import check_compiler

check_compiler()  # before anything here imports the compiler
