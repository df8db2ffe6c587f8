# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How Sphinx builds the documentation: `make docs`, or rosdoc2."""

from pathlib import Path
import sys

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE / 'extensions')]

import cpg_ros  # noqa: E402

project = 'cpg_ros'
author = 'cpg_ros maintainers'
project_copyright = 'cpg_ros maintainers, Apache-2.0'
version = release = cpg_ros.__version__

extensions = ['myst_parser', 'sphinx_design', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon',
              'generated_tables', 'dark_images', 'mathml', 'playground']
html_math_renderer = 'mathml'
# An option such as --help keeps its two hyphens.
smartquotes = False
html_theme = 'furo'
html_static_path = ['static']
html_css_files = ['site.css']
html_js_files = [('copy.js', {'defer': 'defer'})]
html_search_scorer = str(HERE / 'static' / 'scorer.js')
# A list of every name would be the longest page, and the search finds them.
html_use_index = False
html_title = f'cpg_ros {release}'
exclude_patterns = ['_build', 'playground']

# theory.md writes formulas between dollars; headings are linked to as GitHub makes anchors.
myst_enable_extensions = ['dollarmath', 'colon_fence', 'deflist']
myst_heading_anchors = 3

autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
napoleon_use_ivar = True
# Attributes of several classes have one name, and docstrings give names without their modules.
suppress_warnings = ['ref.python']
