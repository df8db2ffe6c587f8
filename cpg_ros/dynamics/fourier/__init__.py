"""Periodic orbits as trigonometric polynomials: for networks with a delay."""

__all__ = ['collocation', 'curve', 'floquet', 'newton', 'orbit', 'solve']
