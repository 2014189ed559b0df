"""The six-joint arm of notebooks/extend: one YAML file and a model without shapes, no Python."""

from pathlib import Path

_FILE = Path(__file__).resolve().parents[2] / "notebooks" / "extend" / "six_joint_arm.yaml"


def write(folder: Path, old: str = "", new: str = "", model: tuple[str, str] = ("", "")) -> Path:
    """Copies robot file and model, each with one text replaced by another; returns its path."""
    path = folder / _FILE.name
    for copy, was, is_now in ((path, old, new), (path.with_suffix(".urdf"), *model)):
        text = (_FILE.parent / copy.name).read_text()
        assert was in text
        copy.write_text(text.replace(was, is_now) if was else text)
    return path
