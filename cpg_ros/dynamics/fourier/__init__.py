"""Periodic orbits as trigonometric polynomials: for networks with a delay."""
