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

"""Builds packages of .msg files for ROS 2 as pip installs it: one extension each, without ament.

usage: python resource/interfaces/build.py PACKAGE_FOLDER ...   (PACKAGE_FOLDER/msg/*.msg)

The generators are those of the wheels; g++ and Python's headers must be there. What it makes goes
into the Python that runs it, and only once all of it is made.
"""

from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile

PREFIX = Path(sys.prefix)
#: The type supports that rmw_fastrtps asks for; it opens their libraries by name.
SUPPORTS = ('rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c')
#: What else a package's messages are made of.
PARTS = ('rosidl_typesupport_c', 'rosidl_generator_c', 'rosidl_generator_py')
LIBRARIES = (*SUPPORTS, 'rosidl_typesupport_fastrtps_cpp', 'rosidl_typesupport_c',
             'rosidl_runtime_c', 'fastcdr', 'rmw', 'rcutils')


def generate(source: Path, work: Path) -> None:
    """Write the C, C++ and Python sources of a package's messages into folders of their own."""
    from rosidl_cli.command.translate.api import translate
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    include, place = [str(PREFIX / 'share')], work / 'idl'
    place.mkdir(parents=True)
    messages = [f'{source}:msg/{file.name}' for file in sorted((source / 'msg').glob('*.msg'))]
    made = translate(package_name=source.name, interface_files=messages, include_paths=include,
                     output_format='idl', output_path=place)
    idl = [f'{place}:{str(one).rpartition(":")[2]}' for one in made]
    for generator in (GenerateC('c'), GenerateFastRTPSCTypesupport('fastrtps_c'),
                      GenerateIntrospectionCTypesupport('introspection_c'),
                      GenerateCTypesupport('c', typesupport_implementations=list(SUPPORTS)),
                      GeneratePython('py', typesupport_implementations=['rosidl_typesupport_c'])):
        generator.generate(source.name, idl, include,
                           work / type(generator).__name__ / source.name)


def compiled(work: Path) -> list[Path]:
    """Compile the sources, and return the objects."""
    import numpy

    folders = [*(one for one in work.iterdir() if one.is_dir()), sysconfig.get_path('include'),
               numpy.get_include(), PREFIX / 'include', *(PREFIX / 'include').iterdir()]
    flags = ['-O1', '-fPIC', '-w', *(f'-I{one}' for one in folders)]
    compilers = {'.c': ('gcc', '-std=c11'), '.cpp': ('g++', '-std=c++17')}

    def object_of(source: Path) -> Path:
        made = work / ('-'.join(source.relative_to(work).parts) + '.o')
        subprocess.run([*compilers[source.suffix], *flags, '-c', source, '-o', made], check=True)
        return made

    sources = sorted(path for path in work.rglob('*') if path.suffix in compilers)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(object_of, sources))


def contained(source: Path) -> set[str]:
    """Return the other packages whose messages a package's messages contain."""
    found = {name for file in (source / 'msg').glob('*.msg')
             for name in re.findall(r'^(\w+)/', file.read_text(), re.MULTILINE)}
    return found - {source.name}


def build(source: Path) -> None:
    """Build a package and put it where this Python finds it."""
    name = source.name
    place = Path(sysconfig.get_path('platlib')) / name
    with tempfile.TemporaryDirectory(dir=place.parent, prefix=f'.{name}') as folder:
        work, made = Path(folder) / 'work', Path(folder) / 'made'
        work.mkdir()
        generate(source, work)
        (made / 'msg').mkdir(parents=True)
        (made / '__init__.py').touch()
        for file in (work / 'GeneratePython' / name / 'msg').glob('*.py'):
            shutil.copy(file, made / 'msg')
        library = f'{name}_s__rosidl_typesupport_c.so'
        subprocess.run(['g++', '-shared', '-o', made / library, *compiled(work),
                        f'-L{PREFIX}/lib', f'-Wl,-rpath,{PREFIX}/lib',
                        *(f'-l{one}' for one in LIBRARIES),
                        *(f'-l{other}__{support}' for other in contained(source)
                          for support in (*SUPPORTS, *PARTS))], check=True)
        shutil.rmtree(place, ignore_errors=True)
        made.rename(place)
    for support in SUPPORTS:
        link = PREFIX / 'lib' / f'lib{name}__{support}.so'
        link.unlink(missing_ok=True)
        link.symlink_to(os.path.relpath(place / library, link.parent))
    print(f'built: {place}')


def main() -> int:
    """Build what the command line names; return the exit code."""
    headers = Path(sysconfig.get_path('include')) / 'Python.h'
    for there, what in ((headers.is_file(), f"Python's headers ({headers}; on Debian and Ubuntu: "
                                            'apt install python3-dev)'),
                        (shutil.which('g++'), 'g++ (on Debian and Ubuntu: apt install g++)')):
        if not there:
            print(f'the messages cannot be built without {what}', file=sys.stderr)
            return 1
    # The generators look for what messages contain there.
    os.environ['AMENT_PREFIX_PATH'] = str(PREFIX)
    for folder in sys.argv[1:]:
        build(Path(folder).resolve())
    return 0


if __name__ == '__main__':
    sys.exit(main())
