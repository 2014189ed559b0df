"""The experience library D: one row per reach, in a folder of Parquet shards.

- `schema`: the columns, which are the fields of `ReachRecord`; `store`: the folder of shards.
- `collect`: every goal from every start in a number of environments.
- `runner`: `simulate(requests, library, workers)`, used wherever reaches are simulated; one
  environment is one task and one shard. `workers`: where the tasks run.
- `add`: rows of a real robot; `pairs`: D2 from D1; `check`: reports.
"""
