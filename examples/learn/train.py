"""Trains the policy by an evolution strategy (Salimans and others, arXiv:1703.03864) and writes its weights and learning curve.

    python examples/learn/train.py

In each generation, pairs of policies that differ from the present one in opposite ways fly the same mission. The present policy
moves towards those that did better. Missions differ in their seed and in the place of the gap.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import policy

import skein

HERE = Path(__file__).parent
#: Where the gap is in the missions of the training, m north of the formation's middle.
GAPS_M = (-10.0, -5.0, 0.0, 5.0, 10.0)
#: Seeds from this one on are not used in training.
TEST_SEED = 1_000_000
#: A drone is through beyond this, m.
THROUGH_M = 90.0
#: The middle of the wall, m.
WALL_M = 70.0
#: Time-out of the mission, s.
TIMEOUT_S = 40.0


def swarm(gap_m):
    """The mission with the gap at another place."""
    walls = {f"obstacle.{number}.centre_m": [70.0, gap_m + side] for number, side in enumerate((57.0, -57.0))}
    return skein.Swarm(HERE / "gap.toml", set=walls, neighbours=policy.NEIGHBOURS, obstacles=policy.OBSTACLES)


def left_m(one, gap_m):
    """The way that each drone has left: to the middle of the gap, and on to where it is through, m."""
    x_m, y_m = one.position_m[:, 0], one.position_m[:, 1]
    before = np.hypot(WALL_M - x_m, gap_m - y_m) + THROUGH_M - WALL_M
    return np.where(x_m < WALL_M, before, np.maximum(THROUGH_M - x_m, 0.0))


def fly(swarms, weights, seed, gap_m):
    """Flies each swarm with its policy. Gives the returns of all, and which of them were a success."""
    for one in swarms:
        one.reset(seed)
    best = [left_m(one, gap_m) for one in swarms]
    clean = [np.ones(one.drones, bool) for one in swarms]
    flying = list(range(len(swarms)))
    while flying:
        rows = np.stack([swarms[number].observations for number in flying])
        for number, action in zip(flying, policy.act(weights[flying], rows), strict=True):
            one = swarms[number]
            one.step(action)
            clean[number] &= ~one.violated.astype(bool)
            # A drone that comes too near to another one or to the wall gets no further.
            best[number] = np.where(clean[number], left_m(one, gap_m), best[number])
        flying = [n for n in flying if swarms[n].outcome is None and best[n].any()]
    best, clean = np.stack(best), np.stack(clean)
    through = (best == 0.0) & clean
    success = through.all(axis=1)
    late = np.array([one.now_s for one in swarms]) / TIMEOUT_S
    returns = through.mean(axis=1) - best.mean(axis=1) / THROUGH_M + 0.3 * clean.mean(axis=1)
    return returns + success * (1.0 - late), success


def train(generations, pairs, seed, spread=0.12, rate=0.06):
    """Gives the weights, and of each generation the mean return and the share of policies that succeeded."""
    random = np.random.default_rng(seed)
    weights = random.normal(0.0, 0.3, policy.SIZE)
    swarms = {gap_m: [swarm(gap_m) for _ in range(2 * pairs)] for gap_m in GAPS_M}
    mean, square = np.zeros(policy.SIZE), np.zeros(policy.SIZE)
    curve = []
    for generation in range(1, generations + 1):
        noise = random.normal(size=(pairs, policy.SIZE))
        tried = weights + spread * np.concatenate([noise, -noise])
        gap_m = GAPS_M[generation % len(GAPS_M)]
        returns, successes = fly(swarms[gap_m], tried, int(random.integers(1, TEST_SEED)), gap_m)
        # Ranks from -0.5 to 0.5, so that one disaster counts no more than another.
        ranks = returns.argsort().argsort() / (len(returns) - 1) - 0.5
        slope = (ranks[:pairs] - ranks[pairs:]) @ noise / pairs - 0.001 * weights
        mean, square = 0.9 * mean + 0.1 * slope, 0.999 * square + 0.001 * slope**2
        steps = mean / (1.0 - 0.9**generation), np.sqrt(square / (1.0 - 0.999**generation))
        weights = weights + rate * steps[0] / (steps[1] + 1e-8)
        curve.append((float(returns.mean()), float(successes.mean())))
        print(f"generation {generation:>3}: mean return {curve[-1][0]:6.3f}, {curve[-1][1]:4.0%} succeed", flush=True)
    return weights, curve


def plot(curve):
    """The learning curve as SVG: the mean return, and the share that succeeds."""
    width, height, left = 640, 260, 50
    returns = np.array([entry[0] for entry in curve])
    low, high = min(returns.min(), -0.5), 2.0

    def line(values, low, high, colour):
        xs = left + np.arange(len(values)) * (width - left - 10) / max(len(values) - 1, 1)
        ys = height - 30 - (np.asarray(values) - low) / (high - low) * (height - 50)
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys, strict=True))
        return f'<polyline fill="none" stroke="{colour}" stroke-width="1.5" points="{points}"/>'

    texts = [
        (left, 14, "#1f77b4", f"mean return ({low:.1f} to {high:.1f})"),
        (left + 200, 14, "#d62728", "share of policies that succeed (0 to 1)"),
        (width - 110, height - 8, "#444", f"generation {len(curve)}"),
        (left, height - 8, "#444", "generation 1"),
    ]
    labels = "".join(f'<text x="{x}" y="{y}" fill="{colour}">{text}</text>' for x, y, colour, text in texts)
    axis = f'<path d="M{left} 20V{height - 30}H{width - 10}" fill="none" stroke="#888"/>'
    lines = line(returns, low, high, "#1f77b4") + line([entry[1] for entry in curve], 0.0, 1.0, "#d62728")
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">'
    return f'{head}<rect width="100%" height="100%" fill="#fff"/>{axis}{lines}{labels}</svg>\n'


def main():
    parser = argparse.ArgumentParser(description="Trains the policy of examples/learn.")
    parser.add_argument("--generations", type=int, default=450)
    parser.add_argument("--pairs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=HERE, help="folder for weights.json and curve.svg")
    args = parser.parse_args()
    weights, curve = train(args.generations, args.pairs, args.seed)
    args.out.mkdir(parents=True, exist_ok=True)
    kept = {"seed": args.seed, "generations": args.generations, "weights": [round(float(w), 4) for w in weights]}
    (args.out / "weights.json").write_text(json.dumps(kept) + "\n")
    (args.out / "curve.svg").write_text(plot(curve))


if __name__ == "__main__":
    main()
