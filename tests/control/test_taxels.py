import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import QueryObject
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from lic_drake.control.taxels import (
    INSIDE_M,
    is_inside,
    make_taxels,
    planar_taxels,
    surface_taxels,
)
from lic_drake.robots.arm import SkinShape
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import Q_HOME, pr2_arm

ARM = planar_arm()
LAYOUT = make_taxels(ARM, 100.0)


def test_the_arm_has_188_taxels_1_cm_apart() -> None:
    assert LAYOUT.num_taxels == 188 == len(LAYOUT.p_LT) == len(LAYOUT.n_L)
    assert LAYOUT.pitch_m == 0.01
    for link in range(3):
        for side in (-1.0, 1.0):
            row = (LAYOUT.link == link) & (np.abs(LAYOUT.n_L[:, 0] - side) < 1e-12)
            y = np.sort(LAYOUT.p_LT[row, 1])
            np.testing.assert_allclose(np.diff(y), 0.01, atol=1e-12)
    tip = (LAYOUT.link == 2) & (LAYOUT.n_L[:, 1] < -1e-12)
    angles = np.rad2deg(np.arctan2(LAYOUT.n_L[tip, 0], -LAYOUT.n_L[tip, 1]))
    np.testing.assert_allclose(np.sort(angles), [-72.0, -36.0, 0.0, 36.0, 72.0], atol=1e-9)


@given(
    st.floats(0.005, 0.05),
    st.floats(0.0, 0.5),
    st.floats(-np.pi, np.pi),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    st.floats(20.0, 200.0),
)
def test_taxels_of_any_capsule_lie_on_its_surface_with_outward_unit_normals(
    radius: float, length: float, angle: float, p_LC: tuple[float, float], per_metre: float
) -> None:
    axis, up = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, 1.0])
    R_LC, p_LS = np.column_stack([up, np.cross(axis, up), axis]), np.append(p_LC, 0.0)
    skin = SkinShape(link="a", kind="capsule", size=(radius, length), R_LS=R_LC, p_LS=p_LS)
    layout = planar_taxels((skin,), (skin.link,), per_metre)
    along = np.clip((layout.p_LT - p_LS) @ axis, -0.5 * length, 0.5 * length)
    nearest = p_LS + along[:, None] * axis
    np.testing.assert_allclose(np.linalg.norm(layout.n_L, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(layout.p_LT, nearest + radius * layout.n_L, atol=1e-12)
    np.testing.assert_allclose(layout.p_LT[:, 2], 0.0, atol=1e-12)
    count = layout.num_taxels - 10
    assert count % 2 == 0
    assert abs(0.5 * count - length * per_metre) <= 1.0 + 1e-9


# In space

PR2 = pr2_arm()
SKIN = make_taxels(PR2, 50.0)


def alone(kind: str, size: tuple[float, ...]) -> SkinShape:
    turned = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return SkinShape(link="a", kind=kind, size=size, R_LS=turned, p_LS=np.ones(3))


def test_taxels_lie_on_the_links_surface_with_normals_out_of_it() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    pr2 = PR2.add_to_plant(plant)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), pr2, Q_HOME)
    query: QueryObject = scene_graph.get_query_output_port().Eval(
        scene_graph.GetMyContextFromRoot(root)
    )
    links = [plant.GetBodyByName(name) for name in PR2.link_names]
    own = [set(plant.GetCollisionGeometriesForBody(body)) for body in links]
    poses = [body.EvalPoseInWorld(plant.GetMyContextFromRoot(root)) for body in links]
    for i in range(0, SKIN.num_taxels, 3):
        link = SKIN.link[i]
        p_WT = poses[link] @ SKIN.p_LT[i]
        n_W = poses[link].rotation() @ SKIN.n_L[i]
        near = [
            item for item in query.ComputeSignedDistanceToPoint(p_WT, 0.5) if item.id_G in own[link]
        ]
        assert min(item.distance for item in near) > -2.0 * INSIDE_M
        touching = [item for item in near if abs(item.distance) < 1e-9]
        assert touching
        assert any(item.grad_W @ n_W > 1.0 - 1e-6 for item in touching)


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("box", (0.2, 0.1, 0.06), 2.0 * (0.2 * 0.1 + 0.1 * 0.06 + 0.2 * 0.06)),
        ("cylinder", (0.08, 0.3), 2.0 * np.pi * 0.08 * (0.08 + 0.3)),
        ("capsule", (0.08, 0.3), 2.0 * np.pi * 0.08 * (2.0 * 0.08 + 0.3)),
    ],
)
@pytest.mark.parametrize("per_metre", [50.0, 100.0])
def test_the_density_is_as_asked_for(
    kind: str, size: tuple[float, ...], area: float, per_metre: float
) -> None:
    layout = surface_taxels((alone(kind, size),), ("a",), per_metre)
    assert layout.num_taxels / area == pytest.approx(per_metre**2, rel=0.05)
    # Closed surface, equal areas: normals and moments of normals cancel.
    np.testing.assert_allclose(layout.n_L.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(layout.p_LT.mean(axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(layout.n_L, axis=1), 1.0)


def test_what_another_shape_of_the_link_covers_has_no_taxel() -> None:
    box, post = alone("box", (0.1, 0.1, 0.1)), alone("cylinder", (0.02, 0.2))
    layout = surface_taxels((box, post), ("a",), 100.0)
    apart = [surface_taxels((shape,), ("a",), 100.0) for shape in (box, post)]
    assert layout.num_taxels < sum(part.num_taxels for part in apart)
    assert not np.any(is_inside(box, layout.p_LT) | is_inside(post, layout.p_LT))


def test_a_thin_end_has_a_taxel_that_faces_straight_ahead() -> None:
    for radius in (0.01, 0.02, 0.05):
        size = (radius, 0.1)
        end = SkinShape(link="a", kind="capsule", size=size, R_LS=np.eye(3), p_LS=np.zeros(3))
        layout = surface_taxels((end,), ("a",), 50.0)
        for sign in (1.0, -1.0):
            facing = layout.n_L @ [0.0, 0.0, sign]
            assert facing.max() == pytest.approx(1.0) and np.sum(facing > 0.999) == 1
