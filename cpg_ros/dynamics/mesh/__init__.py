"""Periodic orbits as polynomials on a mesh: for networks without delay."""

__all__ = ['collocation', 'condensation', 'curve', 'floquet', 'newton', 'orbit', 'solve']
