#!/usr/bin/env python3
"""Flies one swarm for a long time, with a view and a top, and plots what it holds: memory, descriptors, shared memory.

scripts/endurance.py [--minutes 60] [--clock realtime] [--program target/release/skein] [--out endurance]

With --clock lockstep the minutes are simulated ones. Writes samples.csv and endurance.svg. Needs Linux and Python alone.
"""

import argparse
import csv
import json
import os
import pty
import socket
import subprocess
import tempfile
import threading
import time

SCENARIO = "scenarios/open-field.toml"
COLOURS = ["#3366cc", "#dc7633", "#2e8b57", "#8e44ad", "#7f8c8d"]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--clock", default="realtime")
    parser.add_argument("--program", default="target/release/skein")
    parser.add_argument("--out", default="endurance")
    return parser.parse_args()


def start(args):
    """The launcher, in a domain of its own."""
    seconds = args.minutes * 60
    command = [args.program, "run", SCENARIO, "--clock", args.clock, "--out", f"{args.out}/run", "--force", "--every", "50"]
    for key in [f"mission.duration_s={seconds}", 'mission.end="time"', f"time.timeout_s={seconds + 10}"]:
        command += ["--set", key]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def start_view(program):
    """A view with one client that reads all that it is sent."""
    view = subprocess.Popen([program, "view"], stdout=subprocess.PIPE, text=True)
    address = next(word for line in view.stdout for word in line.split() if word.startswith("http://"))
    host, token = address.removeprefix("http://").split("/", 1)
    name, port = host.split(":")
    client = socket.create_connection((name, int(port)))
    lines = [f"GET /socket{token} HTTP/1.1", f"Host: {host}", f"Origin: http://{host}", "Connection: Upgrade",
             "Upgrade: websocket", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "", ""]
    client.sendall("\r\n".join(lines).encode())
    answer = client.recv(4096)
    if b"101" not in answer.split(b"\r\n")[0]:
        raise SystemExit(f"expected the view to open a WebSocket, found {answer[:80]}")
    received = [0]

    def read():
        while data := client.recv(1 << 16):
            received[0] += len(data)

    threading.Thread(target=read, daemon=True).start()
    return view, received


def start_top(program):
    """A top on a terminal that is read."""
    ours, theirs = pty.openpty()
    top = subprocess.Popen([program, "top"], stdin=theirs, stdout=theirs, stderr=subprocess.DEVNULL,
                           env={**os.environ, "TERM": "xterm-256color"})

    def read():
        while os.read(ours, 1 << 16):
            pass

    threading.Thread(target=read, daemon=True).start()
    return top


def memory_mib(pid):
    """Proportional set size."""
    with open(f"/proc/{pid}/smaps_rollup") as file:
        return sum(int(line.split()[1]) for line in file if line.startswith("Pss:")) / 1024


def sample(roles):
    row = {}
    for role, pids in roles.items():
        row[f"{role}_mib"] = sum(memory_mib(pid) for pid in pids)
        row[f"{role}_descriptors"] = sum(len(os.listdir(f"/proc/{pid}/fd")) for pid in pids)
    files = set().union(*(mapped(pid) for pid in roles["launcher"] + roles["world"] + roles["drones"]))
    row["shared_memory_mib"] = sum(os.stat(file).st_blocks for file in files if os.path.exists(file)) / 2048
    return row


def mapped(pid):
    """The files in shared memory that a process maps."""
    with open(f"/proc/{pid}/maps") as file:
        return {line.split()[-1] for line in file if "/dev/shm/" in line and "(deleted)" not in line}


def watch(args, launcher, roles, received):
    rows, began = [], time.monotonic()
    period = 10 if args.clock == "realtime" else 1
    while launcher.poll() is None:
        try:
            row = {"t_s": time.monotonic() - began, **sample(roles)}
        except (FileNotFoundError, ProcessLookupError):
            break  # the flight is over
        rows.append({**row, "view_sent_mib": received[0] / 2**20})
        time.sleep(period)
    return rows


def panel(rows, columns, title, top):
    """One plot, 640 by 150, as SVG."""
    last = rows[-1]["t_s"] or 1
    most = max(max(row[column] for row in rows) for column in columns) * 1.1 or 1
    parts = [f'<g transform="translate(60,{top})"><text x="0" y="-8">{title}</text>',
             '<path d="M0 0V120H560" fill="none" stroke="#888"/>']
    for share in (0, 0.5, 1):
        y = 120 - 120 * share / 1.1
        parts.append(f'<text x="-6" y="{y + 4:.0f}" text-anchor="end">{most * share / 1.1:.0f}</text>')
    for colour, column, place in zip(COLOURS, columns, range(len(columns))):
        points = " ".join(f"{560 * row['t_s'] / last:.1f},{120 - 120 * row[column] / most:.1f}" for row in rows)
        label = column.rsplit("_", 1)[0].replace("_", " ")
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts.append(f'<text x="570" y="{12 + 16 * place}" fill="{colour}">{label}</text>')
    parts.append(f'<text x="560" y="136" text-anchor="end">{last / 60:.0f} min of wall time</text></g>')
    return "".join(parts)


def plot(rows, roles, path):
    memory, descriptors = [[f"{role}_{unit}" for role in roles] for unit in ("mib", "descriptors")]
    panels = [panel(rows, memory, "memory (PSS), MiB", 30), panel(rows, descriptors, "open descriptors", 200),
              panel(rows, ["shared_memory_mib"], "shared memory, MiB", 370)]
    with open(path, "w") as file:
        file.write('<svg xmlns="http://www.w3.org/2000/svg" width="740" height="520" font-family="sans-serif" font-size="12">'
                   '<rect width="740" height="520" fill="white"/>' + "".join(panels) + "</svg>\n")


def main():
    args = arguments()
    os.makedirs(args.out, exist_ok=True)
    # A folder of runs of its own, so that view and top see this swarm alone.
    domain = tempfile.TemporaryDirectory(dir="/dev/shm")
    os.environ["XDG_RUNTIME_DIR"] = domain.name
    launcher = start(args)
    helpers = []
    try:
        processes = f"{args.out}/run/processes.json"
        while not os.path.exists(processes):
            if launcher.poll() is not None:
                raise SystemExit("the flight ended before its first tick")
            time.sleep(0.1)
        with open(processes) as file:
            listed = json.load(file)
        view, received = start_view(args.program)
        helpers = [view, start_top(args.program)]
        pids = lambda role: [process["pid"] for process in listed if process["role"] == role]
        roles = {"launcher": [launcher.pid], "world": pids("world"), "drones": pids("drone"),
                 "view": [view.pid], "top": [helpers[1].pid]}
        rows = watch(args, launcher, roles, received)
    finally:
        for process in helpers:
            process.terminate()
            process.wait()
    code = launcher.wait()
    with open(f"{args.out}/samples.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, roles, f"{args.out}/endurance.svg")
    settled = rows[len(rows) // 10:]
    for column in [name for name in rows[0] if name != "t_s"]:
        print(f"{column:24} {settled[0][column]:10.1f} after a tenth, {settled[-1][column]:10.1f} at the end")
    print(f"the flight ended with exit code {code}")


if __name__ == "__main__":
    main()
