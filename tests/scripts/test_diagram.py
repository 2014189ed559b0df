from pathlib import Path
from xml.etree import ElementTree

import pytest
from pydrake.systems.framework import Diagram
from support.worlds import cylinder, make_clutter

from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import load_scenario
from scripts.diagram.run import draw_diagram, list_connections


@pytest.fixture(scope="module")
def diagram() -> Diagram:
    scenario = load_scenario("cylinder-clutter")
    return make_reach_diagram(scenario, make_clutter(cylinder(0.5, 0.3, movable=True))).diagram


def test_the_list_is_what_drake_says_is_connected(diagram: Diagram) -> None:
    systems = diagram.GetSystems()
    connected = {
        (source.get_name(), output.get_name(), sink.get_name(), into.get_name())
        for source in systems
        for output in (source.get_output_port(i) for i in range(source.num_output_ports()))
        for sink in systems
        for into in (sink.get_input_port(i) for i in range(sink.num_input_ports()))
        if diagram.AreConnected(output, into)
    }
    listed = list_connections(diagram)
    assert len(listed) == len(set(listed))
    inside = {edge for edge in listed if edge[0] != "inputs" and edge[2] != "outputs"}
    assert inside == connected
    exported = [edge for edge in listed if edge not in inside]
    assert len(exported) == diagram.num_input_ports() + diagram.num_output_ports()


def test_an_svg_names_every_system_and_port_and_draws_every_wire(
    diagram: Diagram, tmp_path: Path
) -> None:
    path = tmp_path / "diagram.svg"
    draw_diagram(diagram, path)
    # Matplotlib draws letters as shapes and writes the text into a comment beside them.
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.parse(path, parser).getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    texts = [str(item.text).strip() for item in root.iter() if item.tag is ElementTree.Comment]
    edges = list_connections(diagram)
    names = {system.get_name() for system in diagram.GetSystems()} | {"inputs", "outputs"}
    ports = {(edge[0], edge[1]) for edge in edges} | {(edge[2], edge[3]) for edge in edges}
    assert names <= set(texts)
    assert len(texts) == len(names) + len(ports)
    ids = [item.get("id", "") for item in root.iter() if item.tag is not ElementTree.Comment]
    # The background, a box for each system and a patch for each wire.
    patches = [name for name in ids if name.startswith("patch_")]
    assert len(patches) == 1 + len(names) + len(edges)
