"""The experience library D: one row per reach, in a folder of Parquet shards.

- `schema`: the columns, which are the fields of `ReachRecord`; `store`: the folder of shards.
- `collect`: what a library is to hold (every goal times every start, in some environments).
- `runner`: `simulate(requests, library, workers)`, one environment a task and one shard, wherever
  reaches are simulated: collection, evaluation, bounds, second attempts. It runs on `workers`,
  processes of this machine, or on `dask_workers`, those of a Dask cluster.
- `add`: rows of a real robot; `pairs`: D2 from D1; `check`: reports.
"""
