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

"""Pages that need no other file."""

import base64
from collections.abc import Sequence
from html import escape

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 78em; padding: 0 1em;
       color: #1a202c; background: #fff; }
h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; }
table { border-collapse: collapse; width: 100%; font-size: 0.9em; }
th, td { text-align: left; vertical-align: top; padding: 0.25em 0.6em;
         border-bottom: 1px solid #e2e8f0; overflow-wrap: anywhere; }
th { position: sticky; top: 0; background: #f7fafc; }
td.value { font-variant-numeric: tabular-nums; }
td.note { color: #4a5568; font-size: 0.92em; }
td.verdict { white-space: nowrap; font-weight: 600; }
tr.agrees td.verdict { color: #276749; }
tr.erratum { background: #fffaf0; } tr.erratum td.verdict a { color: #9c4221; }
tr.fails { background: #fff5f5; } tr.fails td.verdict { color: #c53030; }
figure { display: inline-block; margin: 0.5em 1em 1em 0; max-width: 100%; }
figure img { max-width: 100%; border: 1px solid #e2e8f0; }
figcaption { font-size: 0.9em; color: #4a5568; max-width: 40em; }
"""


def page(title: str, parts: Sequence[str]) -> str:
    """Return a page with a title and a body, which is HTML."""
    return '\n'.join(['<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
                      f'<title>{escape(title)}</title><style>{STYLE}</style></head><body>',
                      f'<h1>{escape(title)}</h1>', *parts, '</body></html>', ''])


def html_table(head: Sequence[str], rows: Sequence[str]) -> str:
    """Return a table; its rows are HTML."""
    heads = ''.join(f'<th>{escape(text)}</th>' for text in head)
    return '\n'.join([f'<table><thead><tr>{heads}</tr></thead><tbody>', *rows,
                      '</tbody></table>'])


def image(png: bytes, name: str, caption: str = '') -> str:
    """Return a figure with the picture in it; the caption is HTML."""
    return (f'<figure><img alt="{escape(name)}" src="data:image/png;base64,'
            f'{base64.b64encode(png).decode("ascii")}">{caption}</figure>')
