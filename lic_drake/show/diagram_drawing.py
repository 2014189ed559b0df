"""Draws the systems of a diagram and their connections, without Graphviz."""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from pydrake.systems.framework import Diagram

from lic_drake.errors import LicError

type Edge = tuple[str, str, str, str]
"""A connection: from system, its output port, to system, its input port."""

_WIDTH, _ROW, _GAP = 5.6, 0.3, 2.2


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
    figure = Figure(figsize=(4.9 * len(columns), 6.0))
    ax = figure.subplots()
    ax.set_axis_off()
    ports: dict[tuple[str, str, str], tuple[float, float]] = {}
    for i, names in enumerate(columns):
        y = 0.0
        for name in names:
            inputs = sorted({edge[3] for edge in edges if edge[2] == name})
            outputs = sorted({edge[1] for edge in edges if edge[0] == name})
            height = _ROW * (max(len(inputs), len(outputs)) + 1.5)
            x = i * (_WIDTH + _GAP)
            box = FancyBboxPatch(
                (x, y - height), _WIDTH, height, boxstyle="round,pad=0.02", fc="0.96", ec="0.3"
            )
            ax.add_patch(box)
            ax.text(x + 0.5 * _WIDTH, y - 0.1, name, ha="center", va="top", weight="bold")
            for side, names_of_side, x_port, align, pad in (
                ("in", inputs, x, "left", 0.06),
                ("out", outputs, x + _WIDTH, "right", -0.06),
            ):
                for row, port in enumerate(names_of_side):
                    y_port = y - _ROW * (row + 1.6)
                    ports[side, name, port] = (x_port, y_port)
                    ax.text(x_port + pad, y_port, port, ha=align, va="center", fontsize=6)
            y -= height + 0.5
    for source, output, sink, input_port in edges:
        backwards = ports["in", sink, input_port][0] < ports["out", source, output][0]
        ax.annotate(
            "",
            xy=ports["in", sink, input_port],
            xytext=ports["out", source, output],
            arrowprops={
                "arrowstyle": "->",
                "color": "tab:blue",
                # Wires that run back bend below the boxes, the others hardly.
                "connectionstyle": "arc3,rad=-0.35" if backwards else "arc3,rad=0.06",
            },
        )
    ax.autoscale_view()
    try:
        figure.savefig(path, bbox_inches="tight", dpi=120)
    except (OSError, ValueError) as error:
        raise LicError(f"cannot write the drawing {path}: {error}") from None


def _columns(edges: list[Edge]) -> list[list[str]]:
    """Sorts systems into columns: sources, plant and scene graph, then what they feed.

    A control loop has no first system; the plant is taken as the one where it begins.
    """
    names = sorted({name for edge in edges for name in (edge[0], edge[2])})
    fed = {edge[2] for edge in edges}
    depth = {name: int(name in fed) for name in names}
    for _ in names:
        for source, _, sink, _ in edges:
            if sink not in ("plant", "scene_graph"):
                depth[sink] = max(depth[sink], depth[source] + 1)
    depth = {name: min(value, len(names)) for name, value in depth.items()}
    return [
        column
        for level in sorted(set(depth.values()))
        if (column := [name for name in names if depth[name] == level])
    ]
