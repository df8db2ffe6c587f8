"""What a recording does: its steady stretch, stride, mean cycle, leg phases and gait.

Imports ``networks`` and ``files``; knows nothing of ROS.
"""

__all__ = ['doubts', 'insect_legs', 'leg_motion', 'leg_names', 'leg_phases', 'mean_cycle',
           'period', 'phase_average', 'phase_estimation', 'phase_scatter', 'recognition',
           'steady_stretch', 'stride', 'waveform_comparison']
