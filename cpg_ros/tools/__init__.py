"""Command-line tools: arguments, tables, figures.

Imports every room; nothing imports it.
"""
