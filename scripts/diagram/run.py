"""Draws the systems of a diagram and their connections, without Graphviz.

python scripts/diagram/run.py reach.svg --scenario cylinder-clutter
"""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from pydrake.systems.framework import Diagram

from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import load_scenario
from lic_drake.show.figures import save_figure
from scripts.common import make_parser, run_script

type Edge = tuple[str, str, str, str]
"""A connection: from system, its output port, to system, its input port."""

_WIDTH, _ROW, _GAP = 5.4, 0.36, 2.0


def list_connections(diagram: Diagram) -> list[Edge]:
    """Returns the connections inside a diagram.

    Exported ports connect to two boxes of their own, "inputs" and "outputs".
    """
    edges = [
        (
            source[0].get_name(),
            source[0].get_output_port(source[1]).get_name(),
            sink[0].get_name(),
            sink[0].get_input_port(sink[1]).get_name(),
        )
        for sink, source in diagram.connection_map().items()
    ]
    for i in range(diagram.num_input_ports()):
        for system, port in diagram.GetInputPortLocators(diagram.get_input_port(i).get_index()):
            name = system.get_input_port(port).get_name()
            edges.append(("inputs", diagram.get_input_port(i).get_name(), system.get_name(), name))
    for i in range(diagram.num_output_ports()):
        system, port = diagram.get_output_port_locator(diagram.get_output_port(i).get_index())
        name = system.get_output_port(port).get_name()
        edges.append((system.get_name(), name, "outputs", diagram.get_output_port(i).get_name()))
    return sorted(edges)


def draw_diagram(diagram: Diagram, path: Path) -> None:
    """Writes a drawing: a column for each stage of the data flow, a box for each system.

    Args:
        diagram: A built diagram.
        path: Where to write; the ending (.svg, .png, .pdf) gives the format.

    Raises:
        LicError: The format is unknown or the file cannot be written.
    """
    edges = list_connections(diagram)
    columns = _columns(edges)
    figure = Figure(figsize=(3.2 * len(columns), 5.5))
    ax = figure.subplots()
    ax.set_axis_off()
    ports: dict[tuple[str, str, str], tuple[float, float]] = {}
    for i, names in enumerate(columns):
        x, y = i * (_WIDTH + _GAP), 0.0
        for name in names:
            inputs = sorted({edge[3] for edge in edges if edge[2] == name})
            outputs = sorted({edge[1] for edge in edges if edge[0] == name})
            height = _ROW * (len(inputs) + len(outputs) + 1.5)
            box = FancyBboxPatch(
                (x, y - height), _WIDTH, height, boxstyle="round,pad=0.02", fc="0.96", ec="0.3"
            )
            ax.add_patch(box)
            ax.text(x + 0.5 * _WIDTH, y - 0.1, name, ha="center", va="top", weight="bold")
            sides = [("in", port) for port in inputs] + [("out", port) for port in outputs]
            for row, (side, port) in enumerate(sides):
                left, y_port = side == "in", y - _ROW * (row + 1.6)
                ports[side, name, port] = (x if left else x + _WIDTH, y_port)
                x_text, align = (x + 0.08, "left") if left else (x + _WIDTH - 0.08, "right")
                ax.text(x_text, y_port, port, ha=align, va="center", fontsize=7.5)
            y -= height + 0.5
    for source, output, sink, input_port in edges:
        begin, end = ports["out", source, output], ports["in", sink, input_port]
        # Wires have a colour for each source; those that run back bend downwards.
        bend = "arc3,rad=-0.35" if end[0] < begin[0] else "arc3,rad=0.06"
        color = f"C{[name for column in columns for name in column].index(source)}"
        arrow = {"arrowstyle": "->", "color": color, "connectionstyle": bend, "alpha": 0.8}
        ax.annotate("", xy=end, xytext=begin, arrowprops=arrow)
    ax.autoscale_view()
    save_figure(figure, path)


def _columns(edges: list[Edge]) -> list[list[str]]:
    """Sorts systems into columns: sources and scene graph, plant, then what they feed.

    The control loop is cut at the plant's inputs.
    """
    names = sorted({name for edge in edges for name in (edge[0], edge[2])})
    fed = {edge[2] for edge in edges} - {"scene_graph"}
    depth = {name: int(name in fed) for name in names}
    for _ in names:
        for source, _, sink, _ in edges:
            if sink not in ("plant", "scene_graph"):
                depth[sink] = min(max(depth[sink], depth[source] + 1), len(names))
    levels = sorted(set(depth.values()))
    return [[name for name in names if depth[name] == level] for level in levels]


def main() -> None:
    """Draws the reach diagram of a scenario's first training environment."""
    parser = make_parser(__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--scenario", default="cylinder-clutter")
    args = parser.parse_args()
    scenario = load_scenario(args.scenario)
    instance = scenario.sample_instance("training", 0)
    draw_diagram(make_reach_diagram(scenario, instance).diagram, args.path)


if __name__ == "__main__":
    run_script(main)
