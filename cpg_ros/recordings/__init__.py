"""Recorded and live joint states: bags, CSV files, messages as bytes.

Imports ``files``; knows nothing of ROS.
"""

__all__ = ['bag_reader', 'bag_storage', 'cdr', 'csv_reader', 'joint_streams', 'live_buffer',
           'recording', 'rosbags_library', 'servo', 'stray_samples', 'table_text',
           'thinned', 'unfinished_mcap']
