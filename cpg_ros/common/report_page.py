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

"""Self-contained HTML pages, and figures as the contents of files."""

import base64
from collections.abc import Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

STYLE = '\n' + Path(__file__).with_suffix('.css').read_text('utf-8')


def page(title: str, parts: Sequence[str]) -> str:
    """Return a page with a title and a body, which is HTML."""
    return '\n'.join(['<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
                      f'<title>{escape(title)}</title><style>{STYLE}</style></head><body>',
                      f'<h1>{escape(title)}</h1>', *parts, '</body></html>', ''])


def html_table(head: Sequence[str], rows: Sequence[str]) -> str:
    """Return a table; its rows are HTML."""
    heads = ''.join(f'<th>{escape(text)}</th>' for text in head)
    return '\n'.join([f'<table><thead><tr>{heads}</tr></thead><tbody>', *rows, '</tbody></table>'])


def image(png: bytes, name: str, caption: str = '') -> str:
    """Return a figure with the picture in it; the caption is HTML."""
    return (f'<figure><img alt="{escape(name)}" src="data:image/png;base64,'
            f'{base64.b64encode(png).decode("ascii")}">{caption}</figure>')


def rendered(figure: Any, suffix: str = '.png', dpi: int = 110) -> bytes:
    """Return a figure of matplotlib as the contents of a file with a suffix."""
    out = BytesIO()
    figure.savefig(out, format=suffix.lstrip('.'), dpi=dpi)
    return out.getvalue()
