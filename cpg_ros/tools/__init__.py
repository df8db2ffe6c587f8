"""Command-line tools: arguments, tables, figures.

Imports every room; nothing imports it.
"""

__all__ = ['analysis_plot', 'analysis_report', 'analyze', 'arguments', 'atlas', 'bag_playing',
           'bag_recording', 'calibrate', 'check_robot', 'completion', 'cpg', 'demo', 'demo_course',
           'executables', 'gait_diagram', 'graph_topics', 'inversion', 'inversion_many',
           'optimize', 'reproduce', 'reproduction_report', 'running_node', 'tune']
