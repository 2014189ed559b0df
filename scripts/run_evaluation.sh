#!/bin/sh
# The evaluation at the paper's scale, of all arms: libraries, trials, bounds. Takes hours on two cores;
# run again, it goes on where it was. `lic` and `python` must be those of the project.
set -eu
cd "$(dirname "$0")/.."
results=notebooks/results

lic collect models/experience/cylinder-clutter --environments 20
for library in "passage-clutter 120" "cylinder-aperture-clutter 480" "sphere-aperture-clutter 40" \
    "foliage-aperture-clutter 100"; do
    # shellcheck disable=SC2086
    set -- $library
    [ -e "models/experience/$1/training.parquet" ] ||
        lic collect "models/experience/$1" --scenario "$1" --environments "$2"
done

# Other arms learn from where their estimate so far says so: in pilots 150 to 190 such reaches were worth more than
# 384 from all starts. The last two fifths of the budget are an evaluation that is not kept.
for arm in iiwa14 panda; do
    library=models/experience/$arm-sphere-aperture-clutter
    [ -e "$library/training.parquet" ] && continue
    lic train "out/$arm" --robot "$arm" --set '{clutter: {num_blocked: 10}}' --reaches 5000
    mkdir -p "$library"
    lic experience merge "$library/training.parquet" "out/$arm/learning/reaches"
done

# evaluate CATEGORY ENVIRONMENTS GOALS OPTIONS...
evaluate() {
    category=$1 environments=$2 goals=$3
    shift 3
    lic evaluate "$results/$category" --library "models/experience/$category" \
        --environments "$environments" --goals "$goals" "$@"
}

for category in "cylinder-clutter 200 10" "passage-clutter 2000 1" "cylinder-aperture-clutter 1000 1"; do
    # Tables I to IV.
    evaluate $category --methods rnd cost gp knn
    # Other second choices after LIC-1's failures.
    evaluate $category --methods gp1 'gp>cost' 'gp>rnd'
done
# Further attempts in imagined environments, which takes 8 s each.
evaluate cylinder-clutter 50 10 --methods gp gp1 imagine --variant imagine
# Five attempts.
evaluate cylinder-clutter 50 10 --methods rnd cost gp --attempts 5 --variant five-attempts

# Bounds, at goals of the evaluation.
python scripts/bounds/run.py cylinder-clutter --environments 60 --goals 10
python scripts/bounds/run.py passage-clutter --environments 300
python scripts/bounds/run.py cylinder-aperture-clutter --environments 200
# From the libraries: how much experience it takes, what features and settings bring.
python scripts/learning_curve/run.py
python scripts/cross_validation/run.py models/experience/cylinder-clutter \
    --out $results/cross_validation
python scripts/ablation/run.py models/experience/passage-clutter models/experience/cylinder-clutter
python scripts/real_experience/run.py

# Choices in other environments, by which `lic select` knows how probable success is.
choose() {
    category=$1 environments=$2 goals=$3
    shift 3
    library=models/experience/$category
    lic evaluate "$library/choices" --library "$library" --stream calibration \
        --environments "$environments" --goals "$goals" "$@"
}
choose cylinder-clutter 120 2 --methods gp knn
choose passage-clutter 220 1 --methods gp knn
choose cylinder-aperture-clutter 100 1 --methods gp knn
choose sphere-aperture-clutter 80 1 --methods gp knn --set '{clutter: {num_blocked: 10}}'
choose foliage-aperture-clutter 100 1 --methods gp
choose iiwa14-sphere-aperture-clutter 80 1 --methods gp
choose panda-sphere-aperture-clutter 80 1 --methods gp

# The PR2, with half of the apertures blocked; base and torso move, or stay.
evaluate_pr2() {
    evaluate sphere-aperture-clutter 300 1 --methods rnd cost gp knn \
        --set '{clutter: {num_blocked: 10}}' "$@"
}
evaluate_pr2
# Further attempts in imagined environments, which takes most of a minute each.
evaluate sphere-aperture-clutter 300 1 --methods imagine --set '{clutter: {num_blocked: 10}}'
# What it learns from 250 to 9,540 reaches, collected from every start or where the estimate says so.
learned=$results/learning_curve/sphere-aperture-clutter
[ -e "$learned/training.parquet" ] || {
    lic train out/pr2 --robot pr2 --set '{clutter: {num_blocked: 10}}' --reaches 5000
    mkdir -p "$learned"
    lic experience merge "$learned/training.parquet" out/pr2/learning/reaches
}
python scripts/learning_curve/collection.py
evaluate_pr2 --still --variant still
python scripts/bounds/run.py sphere-aperture-clutter --environments 100 --still \
    --set '{clutter: {num_blocked: 10}}'
python scripts/bounds/race.py sphere-aperture-clutter --environments 300
# Other arms, on pedestals that move.
for arm in iiwa14 panda; do
    evaluate $arm-sphere-aperture-clutter 150 1 --methods rnd cost gp 'gp>cost' imagine
    python scripts/bounds/race.py $arm-sphere-aperture-clutter --environments 150
done

# Before foliage: apertures and goal seen by cameras or known; learned among spheres or foliage.
evaluate_foliage() {
    library=$1 variant=$2
    shift 2
    lic evaluate "$results/foliage-aperture-clutter" --library "models/experience/$library" \
        --scenario foliage-aperture-clutter --environments 100 --goals 1 --variant "$variant" "$@"
}
evaluate_foliage sphere-aperture-clutter cameras --cameras foliage --methods rnd cost gp
evaluate_foliage sphere-aperture-clutter known --methods rnd cost gp
evaluate_foliage foliage-aperture-clutter cameras-foliage --cameras foliage --methods gp
evaluate_foliage foliage-aperture-clutter known-foliage --methods gp
python scripts/bounds/race.py foliage-aperture-clutter --environments 100
