from pathlib import Path

import numpy as np
import pytest
from support.mesh_package import write_drake_models

from lic_drake.errors import ModelError
from lic_drake.show.pr2_meshes import DESCRIPTION, read_pr2_meshes


def test_meshes_are_on_the_links_that_carry_them_where_the_source_has_them(tmp_path: Path) -> None:
    meshes = read_pr2_meshes(write_drake_models(tmp_path))
    found = [(mesh.link, mesh.path.stem, *mesh.X_LM.translation().round(6)) for mesh in meshes]
    assert found == [
        ("base_link", "base", 0.0, 0.0, 0.01),
        ("torso_lift_link", "torso", 0.0, 0.0, 0.01),
        # Our head is one link with the torso's frame; the source's has two joints.
        ("head", "head", -0.01707, 0.0, 0.39145),
        ("head", "head", 0.05093, 0.0, 0.39145),
        ("r_upper_arm_roll_link", "arm", 0.0, 0.0, 0.01),
        ("r_upper_arm_roll_link", "palm", 0.721, 0.0, 0.01),
    ]
    assert [mesh.scale.tolist() for mesh in meshes] == [[1.0] * 3] * 5 + [[2.0] * 3]
    np.testing.assert_allclose(meshes[0].color, [0.2, 0.4, 0.6, 1.0])
    assert meshes[1].color is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: None, "No such file"),
        (lambda text: text[:-20], "cannot be read"),
        (lambda text: text.replace("arm.obj", "lost.obj"), "lost.obj"),
        (lambda text: text.replace("_link", "_rod"), "has no mesh for any link"),
        (lambda text: text.replace("torso_lift_link", "trunk"), "cannot be read.*torso_lift_link"),
    ],
    ids=["missing", "damaged", "without a mesh", "another robot", "a head without a torso"],
)
def test_a_package_that_cannot_be_used_is_one_clear_error(
    change, said: str, tmp_path: Path
) -> None:
    package = write_drake_models(tmp_path)
    path = package / DESCRIPTION
    text = change(path.read_text())
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(ModelError, match=said) as caught:
        read_pr2_meshes(package)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
