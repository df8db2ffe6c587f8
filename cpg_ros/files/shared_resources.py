"""Where the package's shipped files are, installed or in a source tree."""

from pathlib import Path


def share() -> Path:
    """Return the folder that holds ``config``: that of the sources, or share/cpg_ros above.

    Raises:
        FileNotFoundError: the installation is incomplete.

    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent, *(above / 'share' / 'cpg_ros' for above in package.parents)):
        if (folder / 'config' / 'presets').is_dir():
            return folder
    raise FileNotFoundError(f'share/cpg_ros/config is missing from the installation at {package}')
