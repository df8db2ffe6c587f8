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
