"""Many independent jobs on any executor, and recordings inverted by the thousand.

Imports ``inversion`` and what is below; knows nothing of ROS.
"""

__all__ = ['executors', 'many_recordings', 'options', 'outcomes', 'recording_job',
           'recordings_found', 'results', 'results_page', 'results_table', 'tally']
