"""Command-line tools: arguments, tables, figures.

Imports every room; nothing imports it.
"""

__all__ = ['analysis_plot', 'analysis_report', 'analyze', 'arguments', 'calibrate',
           'check_robot', 'cpg', 'demo', 'demo_course', 'executables', 'gait_diagram', 'inversion',
           'optimize', 'reproduce', 'reproduction_report', 'tune']
