"""Drake's meshes change what is seen of a PR2 and nothing else; no test uses a network."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.common import FindResourceOrThrow
from pydrake.geometry import Mesh, Role
from pydrake.systems.framework import DiagramBuilder
from support.mesh_package import go_offline, write_drake_models
from support.worlds import make_clutter

from lic_drake.cli.main import main
from lic_drake.errors import ModelError
from lic_drake.reach.scenario import load_scenario
from lic_drake.scene.scene import Scene, add_scene
from lic_drake.show.pr2_meshes import DESCRIPTION, attach_pr2_meshes, find_drake_models

SCENARIO = load_scenario("sphere-aperture-clutter")


def make_scene(package: Path | None) -> Scene:
    scene = add_scene(
        DiagramBuilder(), SCENARIO.arm(), make_clutter(), SCENARIO.scene, visuals=True
    )
    if package:
        attach_pr2_meshes(scene, package)
    return scene


def shapes_of(scene: Scene, role: Role) -> dict[str, list[tuple[Any, np.ndarray]]]:
    """Shapes and their positions on the links of the robot."""
    inspector = scene.scene_graph.model_inspector()
    return {
        scene.plant.get_body(index).name(): [
            (inspector.GetShape(item), inspector.GetPoseInFrame(item).translation())
            for item in inspector.GetGeometries(scene.plant.GetBodyFrameIdOrThrow(index), role)
        ]
        for index in scene.plant.GetBodyIndices(scene.arm)
    }


@pytest.mark.parametrize("role", [Role.kIllustration, Role.kPerception])
def test_links_show_their_meshes_only_and_the_others_what_they_showed(
    tmp_path: Path, role: Role
) -> None:
    package = write_drake_models(tmp_path)
    bare, meshed = shapes_of(make_scene(None), role), shapes_of(make_scene(package), role)
    expected = {
        "base_link": [("base", 1.0, (0.0, 0.0, 0.01))],
        "torso_lift_link": [("torso", 1.0, (0.0, 0.0, 0.01))],
        # Our head is one link with the torso's frame; the source's has two joints.
        "head": [("head", 1.0, (-0.01707, 0.0, 0.39145)), ("head", 1.0, (0.05093, 0.0, 0.39145))],
        "r_upper_arm_roll_link": [("arm", 1.0, (0, 0, 0.01)), ("palm", 2.0, (0.721, 0.0, 0.01))],
    }
    for name, shapes in meshed.items():
        if name not in expected:
            assert [str(shape) for shape, _ in shapes] == [str(shape) for shape, _ in bare[name]]
            continue
        for (mesh, position), (stem, scale, p_LM) in zip(shapes, expected[name], strict=True):
            assert isinstance(mesh, Mesh)
            assert Path(mesh.source().path()).stem == stem
            assert mesh.scale3().tolist() == [scale] * 3
            np.testing.assert_allclose(position, p_LM, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:-20], "cannot be read"),
        (lambda text: text.replace("_link", "_rod"), "has no mesh for any link"),
    ],
    ids=["damaged", "another robot"],
)
def test_a_package_that_cannot_be_used_is_one_clear_error(
    change: Callable[[str], str], said: str, tmp_path: Path
) -> None:
    path = write_drake_models(tmp_path) / DESCRIPTION
    path.write_text(change(path.read_text()))
    with pytest.raises(ModelError, match=said) as caught:
        make_scene(tmp_path / "drake_models")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_package_is_found_among_the_user_s_or_in_drake_s_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_offline(monkeypatch, tmp_path)
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", "none")
    with pytest.raises(ModelError, match="is not on this machine; name a folder that holds it"):
        find_drake_models()
    source = FindResourceOrThrow("drake/multibody/parsing/drake_models.json")
    params = json.loads(Path(source).read_text())
    prefix = hashlib.sha256(params["strip_prefix"].encode()).hexdigest()
    cache = tmp_path / "cache/drake/package_map"
    cache.mkdir(parents=True, exist_ok=True)
    # Drake's name for it, and the one of earlier versions.
    for name in (f"{params['sha256']}-{prefix}", params["sha256"]):
        (cache / name).symlink_to(write_drake_models(tmp_path / name[-8:]))
    assert (find_drake_models() / DESCRIPTION).is_file()
    package = write_drake_models(tmp_path / "mine")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'none'}:{tmp_path / 'mine'}")
    assert find_drake_models().samefile(package)


def test_the_demo_is_refused_without_the_package_and_for_a_planar_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    go_offline(monkeypatch, tmp_path)
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", "none")
    for robot, said in (("pr2", "is not on this machine"), ("planar-arm", "is for --robot pr2")):
        assert main(["demo", "--robot", robot, "--visuals", "drake_models"]) == 2
        assert said in capsys.readouterr().err
