"""Files and terminals: YAML that people write, atomic writes, shipped resources, progress.

Imports nothing of the package; knows nothing of ROS.
"""

__all__ = ['atomic_write', 'page_style', 'plain_text', 'progress_bar', 'shared_resources',
           'yaml_reader']
