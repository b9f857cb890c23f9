"""pmp's traffic beside SUMO's (flow and speed) and highway-env's (steps a second); called by
scripts/bench_world.sh.

SUMO drives random trips on the net that its netconvert makes of the same map, with cars of pmp's own
parameters of the intelligent driver model. What differs: SUMO has one kind of vehicle, priorities
by road at junctions, routes that end (a new vehicle takes the place), and teleports who has waited
for 300 s; pmp mixes trucks, buses, bicycles, lets in first who asks first, and drives on for ever.
Signals are off and nobody is on foot in both. Rates are steps of 0.1 s per CPU second, medians of
rounds that take turns.
"""

import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

import gymnasium
import highway_env
import sumo

TOOLS = pathlib.Path(sumo.SUMO_HOME) / "tools"
PROGRAMS = pathlib.Path(sys.executable).parent
STEP_S = 0.1
# pmp's car: src/world/kind.rs.
CAR = '<vType id="car" carFollowModel="IDM" length="4.6" width="1.84" accel="1.6" decel="2.0" tau="1.2" minGap="2.0" speedFactor="normc(0.95,0.06,0.85,1.05)"/>'


def run(command, **options):
    """CPU seconds and what was printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"error: {' '.join(map(str, command))}\n{done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def pmp(binary, town, vehicles, walkers, minutes, seed=0):
    command = [binary, "traffic", town, "--vehicles", vehicles, "--walkers", walkers]
    cpu, printed = run([*command, "--minutes", minutes, "--seed", seed, "--jobs", 1, "--json"])
    (report,) = json.loads(printed)
    mean = lambda key: statistics.mean(minute[key] for minute in report["minutes"])
    return {
        "vehicles": report["counts"]["vehicles"],
        "km": report["driven_km"],
        "speed": mean("mean_speed_mps"),
        "stopped": mean("stopped_share"),
        "collisions": len(report["touches_between_vehicles"]),
        "jammed": report["long_stands"][2],
        "cpu": cpu,
    }


def sumo_run(town, vehicles, minutes, folder):
    net, trips = folder / f"{town.stem}.net.xml", folder / f"{town.stem}.trips.xml"
    summary, types = folder / f"{town.stem}.summary.xml", folder / "types.add.xml"
    collisions = folder / f"{town.stem}.collisions.xml"
    types.write_text(f"<additional>{CAR}</additional>")
    convert = [PROGRAMS / "netconvert", "--opendrive-files", town, "-o", net, "--no-warnings"]
    run([*convert, "--tls.discard-loaded", "--ignore-errors"])
    random = [sys.executable, TOOLS / "randomTrips.py", "-n", net, "-o", trips, "-r", folder / f"{town.stem}.rou.xml", "-e", 60 * minutes]
    run([*random, "-p", 0.5, "--seed", 0, "--min-distance", 300, "--validate",
         "--trip-attributes", 'type="car" departLane="best" departSpeed="0"', "--additional-files", types],
        env={**os.environ, "SUMO_HOME": sumo.SUMO_HOME})
    command = [PROGRAMS / "sumo", "-n", net, "-r", trips, "-a", types, "--no-warnings", "--no-step-log"]
    cpu, _ = run([*command, "--step-length", STEP_S, "--end", 60 * minutes, "--max-num-vehicles", vehicles,
                  "--max-depart-delay", 30, "--time-to-teleport", 300, "--collision.action", "warn",
                  "--collision.check-junctions", "--collision-output", collisions, "--summary-output", summary, "--seed", 0])
    # The first minute fills the streets.
    steps = [step.attrib for _, step in ElementTree.iterparse(summary) if step.tag == "step"]
    steps = [step for step in steps if float(step["time"]) > 60 and int(step["running"]) > 0]
    # One that lasts is told again at each step.
    met = {frozenset([c.get("collider"), c.get("victim")]) for c in ElementTree.parse(collisions).iter("collision")}
    running = [int(step["running"]) for step in steps]
    metres = sum(float(step["meanSpeed"]) * int(step["running"]) * STEP_S for step in steps)
    return {
        "vehicles": statistics.mean(running),
        "km": metres / 1000,
        "speed": metres / (sum(running) * STEP_S),
        "stopped": sum(int(step["halting"]) for step in steps) / sum(running),
        "collisions": len(met),
        "jammed": int(steps[-1]["teleports"]),
        "cpu": cpu,
    }


def highway_rate(vehicles, steps=300):
    """Steps of highway-env's road alone per CPU second: no observation, reward or picture."""
    env = gymnasium.make("highway-v0", config={"vehicles_count": vehicles, "lanes_count": 4, "simulation_frequency": 10})
    env.reset(seed=0)
    road = env.unwrapped.road
    begin = time.process_time()
    for _ in range(steps):
        road.act()
        road.step(STEP_S)
    return steps / (time.process_time() - begin)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--binary", type=pathlib.Path, required=True)
    parser.add_argument("--maps", type=pathlib.Path, required=True)
    parser.add_argument("--vehicles", type=int, default=120)
    parser.add_argument("--minutes", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    towns = sorted(options.maps.glob("*.xodr"))

    print(f"Flow, {options.minutes} min, nobody on foot\n")
    print("| town | program | vehicles | km | mean speed, m/s | stopped | collisions | waits of 300 s | CPU-s |\n|---|---|---|---|---|---|---|---|---|")
    for town in towns:
        ours = pmp(options.binary, town, options.vehicles, 0, options.minutes)
        theirs = sumo_run(town, ours["vehicles"], options.minutes, options.folder)
        for name, row in [("pmp", ours), ("SUMO", theirs)]:
            print(f"| {town.stem} | {name} | {row['vehicles']:.0f} | {row['km']:.0f} | {row['speed']:.2f} | {100 * row['stopped']:.1f} % | {row['collisions']} | {row['jammed']} | {row['cpu']:.1f} |", flush=True)

    walkers, minutes = 150, 10
    steps = minutes * 60 / STEP_S
    rates = {}
    for round_ in range(options.rounds):
        for town in towns:
            cpu = pmp(options.binary, town, options.vehicles, walkers, minutes, seed=round_)["cpu"]
            rates.setdefault(f"pmp, {town.stem}, {walkers} on foot", []).append(steps / cpu)
        rates.setdefault("highway-env, highway-v0, nobody on foot", []).append(highway_rate(options.vehicles))
    medians = {name: statistics.median(values) for name, values in rates.items()}
    peer = medians["highway-env, highway-v0, nobody on foot"]
    print(f"\nSteps of 0.1 s per CPU-second, {options.vehicles} vehicles asked for, {options.rounds} rounds, with reading the map\n")
    print("| program | steps per CPU-s | to highway-env |\n|---|---|---|")
    for name, rate in medians.items():
        print(f"| {name} | {rate:.0f} | {rate / peer:.1f} |")


main()
