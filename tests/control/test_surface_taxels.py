import numpy as np
import pytest
from pydrake.geometry import QueryObject
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from lic_drake.control.surface_taxels import INSIDE_M, is_inside, make_taxels, surface_taxels
from lic_drake.control.taxels import planar_taxels
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import Q_HOME, pr2_arm
from lic_drake.robots.skin import SkinShape

ARM = pr2_arm()
LAYOUT = make_taxels(ARM, 50.0)


def alone(kind: str, size: tuple[float, ...]) -> SkinShape:
    turned = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    shape = {"link": "a", "kind": kind, "size": size, "R_LS": turned, "p_LS": np.ones(3)}
    return SkinShape(**shape)  # type: ignore[arg-type]


def test_taxels_lie_on_the_links_surface_with_normals_out_of_it() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    pr2 = ARM.add_to_plant(plant)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), pr2, Q_HOME)
    query: QueryObject = scene_graph.get_query_output_port().Eval(
        scene_graph.GetMyContextFromRoot(root)
    )
    links = [plant.GetBodyByName(name) for name in ARM.link_names]
    own = [set(plant.GetCollisionGeometriesForBody(body)) for body in links]
    poses = [body.EvalPoseInWorld(plant.GetMyContextFromRoot(root)) for body in links]
    for i in range(0, LAYOUT.num_taxels, 3):
        link = LAYOUT.link[i]
        p_WT = poses[link] @ LAYOUT.p_LT[i]
        n_W = poses[link].rotation() @ LAYOUT.n_L[i]
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


def test_a_box_has_rows_at_equal_distances_and_half_of_that_to_the_edges() -> None:
    layout = surface_taxels((alone("box", (0.03, 0.05, 0.02)),), ("a",), 100.0)
    assert layout.num_taxels == 2 * (3 * 5 + 5 * 2 + 3 * 2)
    # Sx, Sy and Sz lie along Ly, Lz and Lx.
    top = layout.p_LT[layout.n_L[:, 0] > 0.5] - 1.0
    np.testing.assert_allclose(top[:, 0], 0.01)
    np.testing.assert_allclose(np.unique(np.round(top[:, 1], 9)), [-0.01, 0.0, 0.01], atol=1e-9)
    np.testing.assert_allclose(
        np.unique(np.round(top[:, 2], 9)), [-0.02, -0.01, 0.0, 0.01, 0.02], atol=1e-9
    )


def test_a_face_has_at_least_one_taxel() -> None:
    layout = surface_taxels((alone("box", (0.1, 0.1, 0.1)),), ("a",), 1.0)
    assert layout.num_taxels == 6


def test_what_another_shape_of_the_link_covers_has_no_taxel() -> None:
    box, post = alone("box", (0.1, 0.1, 0.1)), alone("cylinder", (0.02, 0.2))
    layout = surface_taxels((box, post), ("a",), 100.0)
    apart = [surface_taxels((shape,), ("a",), 100.0) for shape in (box, post)]
    assert layout.num_taxels < sum(part.num_taxels for part in apart)
    assert not np.any(is_inside(box, layout.p_LT) | is_inside(post, layout.p_LT))


def test_every_link_of_the_pr2_feels() -> None:
    counts = np.bincount(LAYOUT.link, minlength=7)
    assert len(counts) == 7
    assert counts.min() >= 40


def test_the_planar_arm_has_the_rows_of_the_paper() -> None:
    expected, layout = planar_taxels(planar_arm().skin), make_taxels(planar_arm(), 100.0)
    assert layout.num_taxels == expected.num_taxels == 188
    np.testing.assert_array_equal(layout.p_LT, expected.p_LT)
