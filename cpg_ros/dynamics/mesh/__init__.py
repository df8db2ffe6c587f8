"""Periodic orbits as polynomials on a mesh: for networks without delay."""

__all__ = ['collocation', 'curve', 'elimination', 'floquet', 'mode', 'newton', 'orbit',
           'periodic_schur', 'solve']
