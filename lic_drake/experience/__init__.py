"""The experience library D: one row per reach in a folder of Parquet shards, and its collection."""
