"""Orbits, their stability, Hopf points and branches.

Imports ``integration`` and what is below; knows nothing of ROS.
"""

__all__ = ['arclength', 'characteristic', 'continuation', 'delay_crossings', 'equilibrium',
           'expansion', 'floquet', 'gait_assessment', 'hopf', 'hopf_search', 'isotypic',
           'isotypic_split', 'normal_form', 'orbit', 'periodic', 'sign_changes', 'stability']
