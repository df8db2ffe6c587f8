"""Weights that give a network a gait, found by NSGA-II.

Imports ``gaits``, ``dynamics`` and what is below; knows nothing of ROS.
"""

__all__ = ['islands', 'nsga2', 'objectives', 'pareto_front', 'search_space', 'settled_cycle',
           'verification']
