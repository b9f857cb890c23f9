"""Reads a dataset with one glob: READER DATASET, where READER is duckdb, pyarrow, pandas, polars or
datasets. Prints, by split, what numpy makes of the columns that the reader gives."""

import datetime
import json
import sys

import numpy


def by_duckdb(dataset):
    import duckdb

    glob = f"{dataset}/frames/*/*.parquet"
    rows = duckdb.execute(
        f"select * from read_parquet('{glob}', hive_partitioning = true) order by episode, frame"
    )
    return rows.to_arrow_table().to_pylist()


def by_pyarrow(dataset):
    import pyarrow.dataset

    table = pyarrow.dataset.dataset(f"{dataset}/frames", partitioning="hive").to_table()
    return table.sort_by([("episode", "ascending"), ("frame", "ascending")]).to_pylist()


def by_pandas(dataset):
    import pandas

    table = pandas.read_parquet(f"{dataset}/frames").sort_values(["episode", "frame"])
    return table.to_dict("records")


def by_polars(dataset):
    import polars

    table = polars.scan_parquet(f"{dataset}/frames/*/*.parquet", hive_partitioning=True)
    return table.sort("episode", "frame").collect().to_dicts()


def by_datasets(dataset):
    # Its card says which files are which split.
    import datasets

    datasets.disable_progress_bars()
    cache = f"{dataset}-cache"
    splits = datasets.load_dataset(dataset, cache_dir=cache)
    rows = [row | {"split": name} for name, split in splits.items() for row in split]
    return sorted(rows, key=lambda row: (row["episode"], row["frame"]))


def nanoseconds(stamp):
    """Since the epoch, of a stamp that knows its zone."""
    assert stamp.tzinfo is not None and stamp.utcoffset() == datetime.timedelta(0), stamp
    whole = int(stamp.replace(microsecond=0).timestamp())
    return whole * 10**9 + stamp.microsecond * 1000


def numbers(rows, column):
    lists = [numpy.asarray(row[column], dtype=float).ravel() for row in rows if is_there(row[column])]
    return numpy.concatenate(lists) if lists else numpy.zeros(0)


def is_there(value):
    return value is not None and not (isinstance(value, float) and numpy.isnan(value))


def facts(rows):
    vectors = ["lidar_pixel", "lidar_x", "lidar_z", "radar_pixel", "radar_speed", "velocity"]
    vectors += ["position", "route", "future_speed", "future_xy", "yaw", "steer", "future_len"]
    vectors += ["image_skew", "lidar_skew", "speed_limit"]
    return {
        "frames": len(rows),
        "stamps": [nanoseconds(row["stamp"]) for row in rows],
        "image_bytes": sum(len(row["image"]) for row in rows),
        "commands": [row["command"] for row in rows],
        "towns": [row["town"] if is_there(row["town"]) else None for row in rows],
        "perturbed": sum(bool(row["perturbed"]) for row in rows),
        "lengths": {name: len(numbers(rows, name)) for name in vectors},
        "sums": {name: float(numbers(rows, name).sum()) for name in vectors},
        "moments": {name: float(numbers(rows, name) @ numpy.arange(len(numbers(rows, name))))
                    for name in vectors},
    }


def main():
    reader, dataset = sys.argv[1:]
    rows = globals()[f"by_{reader}"](dataset)
    splits = sorted({str(row["split"]) for row in rows})
    print(json.dumps({s: facts([row for row in rows if str(row["split"]) == s]) for s in splits}))


main()
