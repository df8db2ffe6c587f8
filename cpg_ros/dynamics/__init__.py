"""Orbits, their stability, Hopf points and branches.

Imports ``integration`` and what is below; knows nothing of ROS.
"""

__all__ = ['arclength', 'bifurcation', 'branch_end', 'characteristic', 'continuation',
           'delay_crossings', 'equilibrium', 'expansion', 'floquet', 'fourier',
           'gait_assessment', 'hopf', 'hopf_search', 'isotypic', 'isotypic_split', 'mesh',
           'normal_form', 'orbit', 'periodic', 'seek', 'sign_changes', 'stability',
           'switching']
