"""How Sphinx builds the documentation: `make docs`, or rosdoc2."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE / 'extensions')]

import cpg_ros  # noqa: E402

project = 'cpg_ros'
author = 'cpg_ros maintainers'
copyright = 'cpg_ros maintainers, Apache-2.0'
version = release = cpg_ros.__version__

extensions = ['myst_parser', 'sphinx_design', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon',
              'sphinx.ext.mathjax', 'generated_tables', 'dark_images']
html_theme = 'furo'
html_static_path = ['static']
html_css_files = ['site.css']
html_title = f'cpg_ros {release}'
exclude_patterns = ['_build']

# theory.md writes formulas between dollars; headings are linked to as GitHub makes anchors.
myst_enable_extensions = ['dollarmath', 'colon_fence', 'deflist']
myst_heading_anchors = 3

autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
napoleon_use_ivar = True
# Attributes of several classes have one name, and docstrings give names without their modules.
suppress_warnings = ['ref.python']
