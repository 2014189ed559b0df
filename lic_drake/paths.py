"""Location of the models folder, in a checkout or an installed wheel."""

from functools import cache
from pathlib import Path

TRAINED = Path("learning", "reaches")
"""The library that a folder of `lic train` holds."""


@cache
def models_dir() -> Path:
    """Returns the folder of robot models, scenarios and shipped libraries."""
    package = Path(__file__).resolve().parent
    for candidate in (package / "models", package.parent / "models"):
        if (candidate / "package.xml").is_file():
            return candidate
    raise FileNotFoundError(f"no models folder beside {package}; reinstall lic_drake")


def scenarios_dir() -> Path:
    """Returns the folder of scenario files."""
    return models_dir() / "scenarios"


def robots_dir() -> Path:
    """Returns the folder of robot files."""
    return models_dir() / "robots"


def shipped_library(category: str, robot: str = "") -> Path:
    """Returns the folder of the experience library shipped for a category.

    That of a robot other than the category's own has both names: iiwa14-sphere-aperture-clutter.
    """
    name = f"{Path(robot).stem}-{category}" if robot else category
    return models_dir() / "experience" / name


def shipped_libraries() -> list[Path]:
    """Returns the folders of all shipped libraries, sorted by category."""
    return sorted(path for path in (models_dir() / "experience").iterdir() if path.is_dir())


def find_library(name_or_path: str | Path) -> Path:
    """Returns the path of a library, or of the shipped one with that name if none exists there.

    The library of a folder of `lic train` is that which it learned from.
    """
    path = Path(name_or_path)
    if (path / TRAINED).is_dir():
        return path / TRAINED
    shipped = shipped_library(path.name)
    return shipped if path.name == str(path) and not path.exists() and shipped.is_dir() else path
