"""Recorded and live joint states: bags, CSV files, messages as bytes.

Imports ``files``; knows nothing of ROS, but for ``rosbag2_library``, which reads bags by it.
"""

__all__ = ['bag_library', 'bag_reader', 'bag_storage', 'cdr', 'csv_reader', 'joint_streams',
           'live_buffer', 'recording', 'rosbag2_library', 'rosbags_library', 'servo',
           'stray_samples', 'table_text', 'thinned', 'unfinished_mcap']
