"""Arguments of the launch files, read from the files: launch itself is not needed."""

import ast
from pathlib import Path

LAUNCH = Path(__file__).resolve().parents[2] / 'launch'


def arguments(name: str) -> dict[str, tuple[str, str]]:
    """Return argument -> (default, what it is) of a launch file."""
    tree = ast.parse((LAUNCH / f'{name}.launch.py').read_text())
    found: dict[str, tuple[str, str]] = {}
    for statement in tree.body:
        if not (isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Dict)):
            continue
        for key, value in zip(statement.value.keys, statement.value.values, strict=True):
            if isinstance(key, ast.Constant) and isinstance(value, ast.Tuple):
                default, text = value.elts[0], value.elts[-1]
                found[key.value] = (default.value if isinstance(default, ast.Constant) else
                                    'the shipped one', ast.literal_eval(text))
    if name == 'rviz':
        found = {**arguments('generator'), **found}
    return {**found, 'namespace': ('', 'namespace of all its topics'),
            'panel': ('false', 'show it in a browser, at http://127.0.0.1:8080/')}
