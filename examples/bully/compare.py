"""The bully election beside Skein's own, over radios that lose messages: how long the swarm has no single leader, and how long it has
several. ``python examples/bully/compare.py`` prints the table of the README."""

import argparse
from pathlib import Path
from statistics import mean

import bully

import skein

HERE = Path(__file__).parent
#: The leader is killed at this time; a drone leads once it has led alone for this long, s.
KILL_S, ALONE_S, END_S, TICK_S = 10.0, 1.0, 30.0, 0.02


class Watched(bully.Bully):
    """Keeps when it leads. The flights are inline, so that all drones keep it in one list."""

    seen = []

    def step(self, senses, inbox, out):
        command = super().step(senses, inbox, out)
        Watched.seen.append((senses.tick, self.me, self.leader == self.me))
        return command


def of_bully(loss, seed):
    """The drones that lead in each tick."""
    Watched.seen = []
    skein.run(HERE / "hover.toml", pilots={"bully": Watched}, set={"radio.loss": loss}, seed=seed, record=False)
    leaders = [set() for _ in range(round(END_S / TICK_S))]
    for tick, drone, leads in Watched.seen:
        if leads and tick < len(leaders):
            leaders[tick].add(drone)
    return leaders


def of_skein(loss, seed):
    """The same for the election of the paper's pilot, with its default periods: heartbeats and time-outs are those of the bully."""
    own = {
        "pilot": [],
        "radio.loss": loss,
        "mission": {"stop_x_m": 1e5},
        "time.timeout_s": END_S,
        "fault": [{"kind": "kill", "target": "leader", "at_s": KILL_S}],
    }
    events = skein.run(HERE / "hover.toml", set=own, seed=seed).events
    leaders, leading, tick = [], set(), 0
    for event in [*events, {"event": "end", "t_s": END_S}]:
        while tick < min(round(event["t_s"] / TICK_S), round(END_S / TICK_S)):
            leaders.append(set(leading))
            tick += 1
        if event["event"] == "leader":
            (leading.add if event["leads"] else leading.discard)(event["leader"])
        elif event["event"] == "fault":
            leading.discard(event["target"])
    return leaders


def wait_s(leaders, begin_s):
    """From this time on, how long it takes until one drone leads, alone, and does so for a while."""
    begin, need = round(begin_s / TICK_S), round(ALONE_S / TICK_S)
    since = None
    for tick in range(begin, len(leaders)):
        if len(leaders[tick]) != 1 or (since is not None and leaders[tick] != leaders[since]):
            since = tick if len(leaders[tick]) == 1 else None
        elif since is None:
            since = tick
        if since is not None and tick - since >= need:
            return (since - begin) * TICK_S
    return END_S - begin_s


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    seeds = range(1, parser.parse_args().seeds + 1)
    print("| election | loss | one leader after the start | after the kill | time with several leaders |")
    print("|---|---|---|---|---|")
    for name, flown in (("bully", of_bully), ("Skein", of_skein)):
        for loss in (0.0, 0.25, 0.5, 0.75):
            runs = [flown(loss, seed) for seed in seeds]
            first, again = (mean(wait_s(run, since_s) for run in runs) for since_s in (0.0, KILL_S))
            several = mean(sum(len(now) > 1 for now in run) * TICK_S for run in runs)
            print(f"| {name} | {loss:.0%} | {first:.2f} s | {again:.2f} s | {several:.2f} s |")


if __name__ == "__main__":
    main()
