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

"""Pictures in two: where NAME_dark.png stands beside NAME.png, each theme shows its own."""

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class DarkImages(SphinxTransform):
    """Adds the dark picture, and marks both for furo."""

    # Before Sphinx collects the files of images.
    default_priority = 100

    def apply(self, **_: Any) -> None:
        """Look at every picture of a page."""
        folder = Path(self.env.doc2path(self.env.docname)).parent
        for image in list(self.document.findall(nodes.image)):
            uri = Path(image['uri'])
            dark = uri.with_name(f'{uri.stem}_dark{uri.suffix}')
            if (folder / dark).is_file():
                other = image.deepcopy()
                other['uri'] = str(dark)
                image['classes'].append('only-light')
                other['classes'].append('only-dark')
                image.parent.insert(image.parent.index(image) + 1, other)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_transform(DarkImages)
    return {'parallel_read_safe': True}
