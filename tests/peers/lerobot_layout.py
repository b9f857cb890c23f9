"""Opens a LeRobot dataset: layout DIR with pyarrow, pandas and Hugging Face's datasets, or
reader DIR with lerobot itself. Prints what they find."""

import json
import pathlib
import sys

import numpy


def columns(rows, name):
    return numpy.asarray([numpy.asarray(row[name], dtype=float).ravel() for row in rows])


def described(values):
    levels = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
    found = {name: getattr(values, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    return found | {name: numpy.quantile(values, q, axis=0).tolist() for name, q in levels.items()}


def layout(root):
    import datasets
    import pandas

    datasets.disable_progress_bars()
    info = json.loads((root / "meta/info.json").read_text())
    stats = json.loads((root / "meta/stats.json").read_text())
    tasks = pandas.read_parquet(root / "meta/tasks.parquet")
    files = sorted(str(path) for path in (root / "meta/episodes").glob("*/*.parquet"))
    episodes = datasets.Dataset.from_parquet(files, cache_dir=f"{root}-cache")
    files = sorted(str(path) for path in (root / "data").glob("*/*.parquet"))
    data = datasets.Dataset.from_parquet(files, cache_dir=f"{root}-cache")
    rows = list(data)
    pictures = [numpy.asarray(row["observation.images.front"]) for row in rows]
    looked_at = [p for p, row in zip(pictures, rows) if row["frame_index"] % info["fps"] == 0]
    colours = numpy.concatenate([picture.reshape(-1, 3) / 255 for picture in looked_at])
    return {
        "info": info,
        "stats": stats,
        "tasks": {str(name): int(row.task_index) for name, row in tasks.iterrows()},
        "episodes": [{k: v for k, v in e.items() if not k.startswith("stats/")} for e in episodes],
        "first_stats": {k: v for k, v in episodes[0].items() if k.startswith("stats/action/")},
        "features": {name: type(feature).__name__ for name, feature in data.features.items()},
        "shapes": sorted({picture.shape for picture in pictures}),
        "rows": [{k: row[k] for k in row if k != "observation.images.front"} for row in rows],
        "action": described(columns(rows, "action")),
        "state": described(columns(rows, "observation.state")),
        "colours": described(colours),
    }


def reader(root):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    step = 1 / json.loads((root / "meta/info.json").read_text())["fps"]
    future = {"action": [0.0, step, 2 * step]}
    dataset = LeRobotDataset("pmp/export", root=root, delta_timestamps=future)
    items = [dataset[i] for i in range(len(dataset))]
    return {
        "episodes": dataset.num_episodes,
        "frames": len(dataset),
        "tasks": [item["task"] for item in items],
        "shapes": sorted({tuple(item["observation.images.front"].shape) for item in items}),
        "actions": [item["action"].tolist() for item in items],
        "padded": [item["action_is_pad"].tolist() for item in items],
        "states": [item["observation.state"].tolist() for item in items],
        "timestamps": [float(item["timestamp"]) for item in items],
    }


def main():
    how, root = sys.argv[1:]
    print(json.dumps({"layout": layout, "reader": reader}[how](pathlib.Path(root))))


main()
