#!/bin/sh
# The 2-D evaluation at the paper's scale: libraries, trials, bounds. Resumable; `lic` and `python`
# must be those of the project.
set -eu
cd "$(dirname "$0")/.."
results=notebooks/results

lic collect models/experience/cylinder-clutter --environments 20
lic collect models/experience/passage-clutter --scenario passage-clutter --environments 120
lic collect models/experience/cylinder-aperture-clutter --scenario cylinder-aperture-clutter \
    --environments 480

# evaluate CATEGORY ENVIRONMENTS GOALS METHODS...: trials, and second attempts chosen otherwise.
evaluate() {
    category=$1 environments=$2 goals=$3
    shift 3
    lic evaluate "$results/$category" --library "models/experience/$category" \
        --environments "$environments" --goals "$goals" --attempts 2 --methods "$@"
}
evaluate cylinder-clutter 200 10 rnd cost gp knn
evaluate passage-clutter 2000 1 rnd cost gp knn
evaluate cylinder-aperture-clutter 1000 1 rnd cost gp knn
