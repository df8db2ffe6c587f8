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

"""XML that others write, as a tree: without entities, and no deeper than anything is described."""

from collections.abc import Callable
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from cpg_ros.errors import CpgError

#: Elements within one another; descriptions of robots have a dozen, assemblies in Collada more.
DEEPEST = 200
#: Elements of a document; a robot with meshes has a few thousand.
MOST = 1_000_000


def parse(data: bytes, fail: Callable[[str], CpgError]) -> Element:
    """Return the root of a document; names keep their prefixes, which need not be declared.

    Args:
        data: the file.
        fail: makes the error out of its reason.

    Raises:
        CpgError: as ``fail`` makes it: it is no XML, declares an entity, is nested too deep,
            or has too many elements.

    """
    builder, parser, depth, count = TreeBuilder(), expat.ParserCreate(), 0, 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if count > MOST:
            raise fail(f'it has more than {MOST} elements')
        if depth > DEEPEST:
            raise fail(f'line {parser.CurrentLineNumber}: elements are nested more than '
                       f'{DEEPEST} deep')
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(name: str, *_: object) -> None:
        raise fail(f"it declares the entity '{name}'; entities are not read")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.EntityDeclHandler = builder.data, entity
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise fail(f'line {error.lineno}: {expat.ErrorString(error.code)}') from error
    except CpgError:
        raise
    # An encoding that Python does not know, or cannot use.
    except (ValueError, LookupError) as error:
        raise fail(str(error)) from error
    return builder.close()
