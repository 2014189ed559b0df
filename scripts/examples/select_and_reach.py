"""Selects a start with LIC-1, reaches, and after a failure selects again with LIC-2; records it."""

from pathlib import Path

import numpy as np

import lic_drake as lic

library = lic.ExperienceLibrary(lic.shipped_library("passage-clutter"))
scenario = library.scenario()
selector = lic.make_selector("gp", library.columns())
p_WG = scenario.sample_goal("evaluation", 24)
trial = lic.run_trial(scenario, selector, "evaluation", 24, p_WG, attempts=2)

recording = lic.Recording(scenario, scenario.sample_instance("evaluation", 24))
for attempt in trial:
    start, estimate = attempt.selection.start, attempt.selection.probability
    print(f"x0 {np.round(start.x0, 3)}, estimated {estimate:.2f}: {attempt.record.outcome}")
    recording.move_to(start.b0, start.q)
    result = lic.simulate_request(attempt.request, keep_states=True)
    recording.add_reach(result.trace, p_WG)
    recording.retract(result.trace)
recording.save(Path("select_and_reach.html"))
