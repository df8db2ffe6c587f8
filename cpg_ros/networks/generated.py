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

"""What is compiled and generated from a network's equations, kept on disk between processes."""

from collections.abc import Callable
from functools import cache
import hashlib
import importlib.util
from pathlib import Path
import sys
from types import ModuleType

from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.cache_folder import cache_folder, writing

#: Subpackages with compiled code, and with the numbers that it takes from elsewhere.
_COMPILED = ('networks', 'integration', 'dynamics', 'motion', 'feedback')


def folder(key: str = 'package') -> Path | None:
    """Return where code is kept: of the package, or what follows from a network's equations.

    Its name has a digest of the sources. numba's own cache watches only the file that a kernel
    stands in, not those of the functions it calls; here any edit leads to another folder.

    Args:
        key: of the equations, see Equations.key.

    Returns:
        The folder, None if nothing can be written.

    """
    return cache_folder(f'{key}-{_sources_digest()}')


@cache
def _sources_digest() -> str:
    """Return a word that changes whenever a file with compiled code does."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for room in _COMPILED:
        for source in sorted((package / room).rglob('*.py')):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:14]


def load(key: str, name: str, write: Callable[[], str]) -> ModuleType:
    """Return a generated module, written first where it is not on disk yet.

    Args:
        key: of the equations that it follows from.
        name: of the module.
        write: makes the text.

    """
    known = f'cpg_ros_generated_{key}_{name}'
    if known in sys.modules:
        return sys.modules[known]
    place = folder(key)
    path = None if place is None else place / f'{name}.py'
    if path is None or not path.exists():
        text = write()
        if path is not None:
            with writing():
                write_atomically(path, text)
        if path is None or not path.exists():
            module = sys.modules[known] = ModuleType(known)
            exec(compile(text, known, 'exec'), vars(module))
            return module
    spec = importlib.util.spec_from_file_location(known, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Under its name, or numba's disk cache does not find the module of what it has compiled.
    sys.modules[known] = module
    spec.loader.exec_module(module)
    return module
