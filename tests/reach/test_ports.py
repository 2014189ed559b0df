"""The page on ports, lic_drake/control/README.md, says what the diagram has."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.framework import PortDataType

import lic_drake as lic
from lic_drake.control.taxels import make_taxels
from lic_drake.reach.rig import Rig
from lic_drake.reach.simulation import Simulation, simulate
from scripts.diagram.run import list_connections

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = (CHECKOUT / "lic_drake" / "control" / "README.md").read_text(encoding="utf-8")
SYSTEMS, WIRES = (
    [[cell.strip() for cell in row.strip("| \n").split("|")] for row in table.splitlines()[2:]]
    for table in re.findall(r"(?:^\|.*\n)+", PAGE, re.MULTILINE)
)


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


@pytest.mark.parametrize(
    "scenario",
    ["cylinder-clutter", "passage-clutter", "sphere-aperture-clutter", "foliage-aperture-clutter"],
)
def test_the_page_has_every_system_every_wire_and_its_size(scenario: str) -> None:
    loaded = lic.load_scenario(scenario)
    instance = loaded.sample_instance("training", 0)
    reach, stems = lic.make_reach_diagram(loaded, instance), instance.stems
    diagram, plant, scene = reach.diagram, reach.scene.plant, reach.scene
    systems = {system.get_name(): system for system in diagram.GetSystems()}
    assert {names(row[0])[0] for row in SYSTEMS} == set(systems)
    sizes = {
        "m": loaded.arm().num_joints,
        "T": make_taxels(loaded.arm(), loaded.scene.taxels_per_m).num_taxels,
        "a": 2 if loaded.arm().is_planar or stems else 3,
        "k": instance.movable.sum() + (np.isfinite(stems.stiffness).sum() if stems else 0),
        "f": plant.num_actuated_dofs(scene.clutter),
    }
    model = plant.GetModelInstanceName(scene.arm)
    written = set()
    for source, port, size, _, sinks in WIRES:
        (source,), (port,) = names(source), names(port)
        port = port.replace("<arm>", model)
        for sink in names(sinks.replace("<arm>", model)):
            written.add((source, port, *sink.split(".")))
        if source == "diagram":
            found = diagram.GetInputPort(port)
        else:
            found = systems[source].GetOutputPort(port)
        if size == "abstract":
            assert found.get_data_type() == PortDataType.kAbstractValued
        else:
            factors = [sizes[word] if word in sizes else int(word) for word in size.split()]
            assert found.size() == np.prod(factors), (source, port)
    outside = {"inputs": "diagram", "outputs": "diagram"}
    assert written == {
        (outside.get(source, source), port, outside.get(sink, sink), into)
        for source, port, sink, into in list_connections(diagram)
    }
    (period,) = re.findall(r"([\d.]+) s", next(r[2] for r in SYSTEMS if "controller" in r[0]))
    assert float(period) == loaded.mpc.period_s


def test_a_controller_of_ones_own_runs_alone_and_under_the_stop_rules() -> None:
    example = runpy.run_path(str(CHECKOUT / "scripts" / "examples" / "own_controller.py"))
    scenario, start, p_RG = (example[name] for name in ("scenario", "start", "p_RG"))
    reach = lic.make_reach_diagram(scenario, example["instance"], controller=example["Yielding"])
    context = reach.diagram.CreateDefaultContext()
    reach.set_start(context, start.q, p_RG)
    reach.make_simulator(context).AdvanceTo(0.5)
    state = reach.diagram.GetOutputPort("desired_state").Eval(context)
    q_d = state[:3]
    assert np.linalg.norm(state[3:]) == 0.0
    # Before it touches anything, it has gone towards the goal at its speed.
    before, after = (scenario.arm().calc_pose(q).p_RE for q in (start.q, q_d))
    assert (after - before) @ (p_RG - before) / np.linalg.norm(p_RG - before) > 0.01
    scenario.stop.timeout_s = 2.0
    outcome, trace, _ = simulate(Simulation(Rig(reach)), scenario, start.q, p_RG)
    assert outcome == "timeout" and trace.time_s[-1] == pytest.approx(2.0, abs=0.05)


def test_a_controller_with_other_ports_is_refused() -> None:
    scenario = lic.load_scenario("cylinder-clutter")
    other = lic.load_scenario("sphere-aperture-clutter").arm()
    usual = lic.make_reach_diagram(scenario, scenario.sample_instance("training", 0))
    with pytest.raises(RuntimeError, match=r"sizes.*arm_state"):
        lic.make_reach_diagram(
            scenario,
            scenario.sample_instance("training", 0),
            controller=lambda arm, layout, config: type(usual.controller)(other, layout, config),
        )
