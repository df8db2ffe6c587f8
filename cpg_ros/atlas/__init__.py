"""Maps of where gaits live, over two parameters, with their exact boundaries.

Imports ``fleet``, ``dynamics`` and what is below; knows nothing of ROS.
"""

__all__ = ['chart', 'fold_curves', 'hopf_curves', 'map_page', 'map_picture', 'orbit_curves',
           'refinement', 'row_job', 'stored']
