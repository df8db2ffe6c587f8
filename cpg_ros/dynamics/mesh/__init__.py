"""Periodic orbits as polynomials on a mesh: for networks without delay."""
