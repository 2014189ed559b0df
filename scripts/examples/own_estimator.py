"""Collects a small library and selects with a classifier of scikit-learn that it teaches."""

from pathlib import Path

import numpy as np
from sklearn.ensemble import RandomForestClassifier

import lic_drake as lic

lic.register_estimator(
    "forest", lambda features: lic.from_sklearn(RandomForestClassifier(50, random_state=0))
)

scenario = lic.load_scenario("cylinder-clutter")
request = lic.CollectionRequest(scenario=scenario, environments=3, max_goals=3, max_starts=4)
library = lic.ExperienceLibrary(Path("small_library"))
lic.collect(library, request)  # Interrupted, it goes on where it was.
print(f"{library.num_reaches} reaches, {library.columns()['success'].mean():.0%} succeeded")

selector = lic.make_selector("forest", library.columns())
starts = lic.make_starts(scenario, scenario.sample_instance("holdout", 0))
chosen = selector.select(lic.Situation(p_WG=np.array([0.6, 0.1, 0.0]), starts=starts))
print(f"the forest chooses {np.round(chosen.start.x0, 3)} at {chosen.probability:.2f}")
