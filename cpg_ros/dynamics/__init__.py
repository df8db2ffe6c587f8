"""Orbits, their stability, Hopf points and branches.

Imports ``integration`` and what is below; knows nothing of ROS.
"""

__all__ = ['arclength', 'cell_hopf', 'cell_orbit', 'characteristic', 'continuation', 'curves',
           'delay_floquet', 'delayed_orbit', 'equilibrium', 'floquet', 'fourier',
           'gait_assessment', 'gauss', 'hopf', 'isotypic', 'mesh_floquet', 'mesh_newton',
           'mesh_orbit', 'normal_form', 'orbit', 'periodic', 'sign_changes', 'stability']
