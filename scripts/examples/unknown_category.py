"""Selects where the clutter is cylinders or a passage, each as likely: a mixture of estimates."""

import numpy as np

import lic_drake as lic
from lic_drake.select.lic import LicSelector
from scripts.unknown_category.mixture import Category, MixtureLic

categories = {}
for name in ("cylinder-clutter", "passage-clutter"):
    library = lic.ExperienceLibrary(lic.shipped_library(name))
    scenario = library.scenario()
    known = lic.make_selector("knn", scenario.arm(), library.columns(), category=name)
    assert isinstance(known, LicSelector)
    categories[name] = Category(probability=0.5, lic=known)
mixture = MixtureLic(categories)

p_WG = scenario.sample_goal("evaluation", 1)
starts = lic.make_starts(scenario, scenario.sample_instance("evaluation", 1))
situation = lic.Situation(p_WG=p_WG, starts=starts)
first = mixture.select(situation)
print(f"first choice {np.round(first.start.x0, 3)} at {first.probability:.2f}")
record = lic.run_reach(lic.ReachRequest(scenario, "evaluation", 1, p_WG, first.start))
if not record.success:
    failed = (lic.FailedReach.from_record(record),)
    after = lic.Situation(p_WG=p_WG, starts=starts, failed=failed)
    print({name: round(p, 2) for name, p in mixture.belief(after).items()})
    print(f"second choice {np.round(mixture.select(after).start.x0, 3)}")
