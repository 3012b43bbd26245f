"""Flies a grid in formation with RVO2 and prints the CPU time of a step. Arguments: one JSON object."""

import json
import sys
import time

import pyrvo

flight = json.loads(sys.argv[1])
positions, ticks = flight["positions_m"], flight["ticks"]
swarm = pyrvo.RVOSimulator(
    flight["dt_s"],
    flight["neighbour_m"],
    flight["neighbours"],
    flight["horizon_s"],
    flight["horizon_s"],
    flight["radius_m"],
    flight["speed_max_mps"],
)
for x, y in positions:
    agent = swarm.add_agent((x, y))
    swarm.set_agent_velocity(agent, (flight["speed_mps"], 0.0))
    swarm.set_agent_pref_velocity(agent, (flight["speed_mps"], 0.0))
for _ in range(flight["warm_up"]):
    swarm.do_step()
before = time.process_time()
for _ in range(ticks):
    swarm.do_step()
used_s = time.process_time() - before
flown_m = swarm.get_agent_position(0).x - positions[0][0]
print(json.dumps({"cpu_s": used_s, "steps": ticks * len(positions), "flown_m": flown_m}))
