"""Code that is generated from a network's equations, kept on disk between processes."""

import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

from cpg_ros.files.atomic_write import write_atomically


@cache
def folder() -> Path:
    """Return where generated code is kept, created if need be.

    As numba's own cache: ``NUMBA_CACHE_DIR`` if it is set, else beside the package where that can
    be written to, else among the user's caches, else a temporary folder of this process.
    """
    own = Path(__file__).resolve().parent / '__pycache__'
    wanted = [Path(os.environ['NUMBA_CACHE_DIR'])] if os.environ.get('NUMBA_CACHE_DIR') else [
        own, Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'cpg_ros']
    for place in wanted:
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place, os.W_OK):
            return place
    return Path(tempfile.mkdtemp(prefix='cpg_ros_'))


def load(name: str, write: Callable[[], str]) -> ModuleType:
    """Return a generated module, written first where it is not on disk yet.

    Args:
        name: of the module, which says all that its text depends on.
        write: makes the text.

    """
    path, known = folder() / f'{name}.py', f'cpg_ros_generated_{name}'
    if known in sys.modules:
        return sys.modules[known]
    if not path.exists():
        write_atomically(path, write())
    spec = importlib.util.spec_from_file_location(known, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Under its name, or numba's disk cache does not find the module of what it has compiled.
    sys.modules[known] = module
    spec.loader.exec_module(module)
    return module
