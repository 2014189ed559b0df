"""Draws what the cameras see of a scene of the foliage, and what perception finds in it.

    python scripts/perception/draw.py notebooks/results/perception

Writes head.png and external.png, without noise, and detections.jpg, with it.
"""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.image import imsave

from lic_drake.perception.apertures import find_apertures
from lic_drake.perception.cameras import take_views
from lic_drake.perception.config import load_cameras
from lic_drake.perception.goal import find_goal
from lic_drake.perception.observer import board_of
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator
from lic_drake.show.detections import draw_apertures, draw_goal
from lic_drake.show.figures import save_figure
from scripts.common import make_parser, run_script
from scripts.perception.errors import disturbed_views


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("results", type=Path, help="folder for the pictures")
    parser.add_argument(
        "--scene", type=int, default=0, help="environment of the calibration stream"
    )
    args = parser.parse_args()
    scenario, cameras = load_scenario("foliage-aperture-clutter"), load_cameras()
    instance = scenario.sample_instance("calibration", args.scene)
    p_WG = scenario.sample_goal("calibration", args.scene)
    rng = make_generator("calibration", "camera errors", args.scene)
    exact = take_views(instance, p_WG, cameras)
    views = disturbed_views(exact, cameras, rng)
    board = board_of(scenario)
    apertures = find_apertures(views.head, cameras.head.camera, board)
    goal = find_goal(views.external, cameras.external.camera, cameras.ball_radius_m)
    args.results.mkdir(parents=True, exist_ok=True)
    imsave(args.results / "head.png", exact.head.color)
    imsave(args.results / "external.png", exact.external.color)
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_apertures(left, views.head, apertures).set_title("probability of being open", fontsize=9)
    draw_goal(right, views.external, goal, cameras.ball_radius_m)
    save_figure(figure, args.results / "detections.jpg")


if __name__ == "__main__":
    run_script(main)
