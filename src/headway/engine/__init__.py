"""Integrates scenarios."""
