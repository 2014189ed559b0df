"""A robot from one YAML file, without any Python, and files that describe none."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from support.six_joint_arm import write

from lic_drake.errors import ScenarioError
from lic_drake.paths import robots_dir
from lic_drake.reach.scenario import load_scenario, parse_scenario
from lic_drake.robots.registry import get_robot

SPHERES = "sphere-aperture-clutter"


def test_one_file_makes_an_arm(tmp_path: Path) -> None:
    arm = get_robot(str(write(tmp_path)))
    assert (arm.name, arm.num_joints) == ("six_joint_arm", 6)
    assert arm.link_names == ("upper_arm", "forearm", "roll", "wrist", "hand")
    assert {shape.kind for shape in arm.skin} == {"capsule"}
    np.testing.assert_allclose(arm.calc_pose(np.zeros(6)).p_RE, [1.02, -0.2, 0.78], atol=1e-12)
    np.testing.assert_allclose(arm.calc_pose(arm.q_home).R_RE[:, 0], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(arm.stiffness, [60.0, 60.0, 30.0, 15.0, 15.0, 10.0])
    # Along its axis the first joint moves nothing: the arm is as long as from there.
    np.testing.assert_allclose(arm.p_RS, [0.0, -0.2, 0.78], atol=1e-12)
    assert arm.reach_m == pytest.approx(1.02)
    (q, *_) = arm.solve_pointing(np.array([[0.55, -0.2, 0.7]]), np.array([1.0, 0.0, 0.0]))[0]
    np.testing.assert_allclose(arm.calc_pose(q).p_RE, [0.55, -0.2, 0.7], atol=1e-9)


def test_limits_narrow_the_models_and_a_held_joint_is_none(tmp_path: Path) -> None:
    old = "roll_joint: {stiffness: 15.0, damping: 1.0, home_deg: 0.0}"
    held = get_robot(str(write(tmp_path, old, "roll_joint: {held: 0.1}")))
    assert held.num_joints == 5
    narrow = get_robot(str(write(tmp_path, old, old.replace("{", "{lower_deg: -30, "))))
    assert narrow.q_min[3] == pytest.approx(np.deg2rad(-30.0))
    assert narrow.q_max[3] == 2.5


def test_a_scenario_finds_the_file_beside_itself_and_knows_its_content(tmp_path: Path) -> None:
    path = write(tmp_path)
    text = f"{{category: {SPHERES}, robot: {path.name}, task: {{torso_m: 0.1}}}}"
    (tmp_path / "mine.yaml").write_text(text)
    first = load_scenario(tmp_path / "mine.yaml")
    assert first.robot == str(path) and first.arm().num_joints == 6
    digest = parse_scenario(text, source=str(tmp_path / "mine.yaml")).digest
    assert digest == first.digest
    write(tmp_path, "damping: 5.0", "damping: 6.0")
    assert load_scenario(tmp_path / "mine.yaml").digest != digest


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "model: six_joint_arm.urdf",
            "model: none.urdf",
            "none.urdf is no URDF or SDF file; give its path",
        ),
        ("model: six_joint_arm.urdf", "", "model must be a URDF or SDF file"),
        (
            "model: six_joint_arm.urdf",
            "model: package://no/arm.urdf",
            "cannot find package://no/arm.urdf",
        ),
        ("frame: column", "frame: pillar", "base: frame 'pillar' is not in the model; it has"),
        ("frame: hand", "frame: gripper", "tip: frame 'gripper' is not in the model; it has"),
        ("xyz: [0.0, -0.2, 0.7]", "xyz: [0.0, -0.2]", "xyz must be 3 finite numbers"),
        ("link: wrist", "link: fist", "capsules: link 'fist' is not in the model; it has"),
        ("  wrist_joint", "  fist_joint", "joints: 'fist_joint' is not in the model; it has"),
        ("[roll, hand]", "[roll, fist]", "ignored_contacts: link 'fist' is not in the model"),
        ("radius_m: 0.03", "radius_m: -1.0", "capsules: that of 'upper_arm' needs ends"),
        ("skin_links: all", "skin_links: [turret]", "needs a collision shape: turret has none"),
        ("skin_links: all", "skin_links: [fist]", "fist"),
        ("stiffness: 30.0, ", "", "forearm_joint: needs a positive stiffness"),
        ("stiffness: 30.0", "stiffness: soft", "soft"),
        ("stiffness: 30.0, damping: 5.0, ", "", "forearm_joint needs an actuator with controller"),
        ("home_deg: -50.0", "home: 50.0", "home"),
        ("home_deg: -50.0", "home_deg: 0, lower_deg: 170.0", "no position is within limits of"),
        ("carriage: add", "carriage: [x, y]", "carriage must be add, or the joints along"),
        ("carriage: add", "carriage: [x, y, z]", "'x'"),
        ("[0.0, 0.4]", "[0.4, 0.0]", "height_range_m must be [least, most]"),
        ("carriage: add", "wheels: 3", "['wheels'] were unknown"),
        ("carriage: add", "carriage: {", "not YAML"),
    ],
)
def test_files_that_describe_no_arm_are_refused_in_one_line(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    path = write(tmp_path, old, new)
    with pytest.raises(ScenarioError) as error:
        get_robot(str(path))
    message = str(error.value)
    assert message.startswith(str(path)) and said in message and "\n" not in message


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('lower="-2.5" upper="2.5" ', "", "joint turret_joint has no limits"),
        ("inertial>", "ignored>", "joint turret_joint moves no mass; give its link an inertia"),
        ("</robot>", "", "is not XML"),
        ('type="revolute"', 'type="prismatic"', "joint turret_joint is not revolute"),
    ],
)
def test_models_that_are_no_arm_are_refused_in_one_line(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    path = write(tmp_path, model=(old, new))
    with pytest.raises(ScenarioError) as error:
        get_robot(str(path))
    message = str(error.value)
    assert message.startswith(str(path)) and said in message and "\n" not in message


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no robot .*none\.yaml.*shipped robots: iiwa14, pan"):
        get_robot(str(tmp_path / "none.yaml"))


def test_joints_too_stiff_for_the_controller_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "stiffness: 30.0", "stiffness: 3000.0")
    with pytest.raises(ScenarioError, match="forearm_joint of six_joint_arm, 3000 Nm/rad, is too"):
        load_scenario(SPHERES, f"{{robot: {path}}}")
    # A joint whose links carry no skin presses nothing, however stiff.
    with pytest.raises(ScenarioError, match="iiwa_joint_2 of iiwa14, 5000 Nm/rad, is too"):
        load_scenario(SPHERES, f"{{robot: {stiff_iiwa(tmp_path)}}}")


def stiff_iiwa(folder: Path) -> Path:
    content = yaml.safe_load((robots_dir() / "iiwa14.yaml").read_text())
    content["model"] = str((robots_dir() / content["model"]).resolve())
    content["skin_links"] = ["iiwa_link_3", "iiwa_link_4"]
    content["joints"]["iiwa_joint_2"]["stiffness"] = 5000.0
    (folder / "iiwa14.yaml").write_text(yaml.safe_dump(content))
    return folder / "iiwa14.yaml"


def test_the_pedestal_is_upright_however_the_arm_is_mounted(tmp_path: Path) -> None:
    content = yaml.safe_load(stiff_iiwa(tmp_path).read_text())
    content["base"]["rpy_deg"] = [0.0, 90.0, 0.0]
    content["joints"]["iiwa_joint_2"]["stiffness"] = 50.0
    (tmp_path / "iiwa14.yaml").write_text(yaml.safe_dump(content))
    plant = MultibodyPlant(time_step=0.0)
    graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(graph)
    get_robot(str(tmp_path / "iiwa14.yaml")).add_to_plant(plant)
    plant.Finalize()
    (pedestal,) = (
        g for g in all_geometries(plant) if "pedestal" in graph.model_inspector().GetName(g)
    )
    X_BP = graph.model_inspector().GetPoseInFrame(pedestal)
    body = plant.GetBodyFromFrameId(graph.model_inspector().GetFrameId(pedestal))
    X_WP = plant.EvalBodyPoseInWorld(plant.CreateDefaultContext(), body) @ X_BP
    np.testing.assert_allclose(X_WP.rotation().matrix()[:, 2], [0.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(X_WP.translation()[:2], content["base"]["xyz"][:2], atol=1e-9)
    assert X_WP.translation()[2] < content["base"]["xyz"][2]


def all_geometries(plant: MultibodyPlant) -> list[GeometryId]:
    bodies = (plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies()))
    return [g for body in bodies for g in plant.GetCollisionGeometriesForBody(body)]
