"use strict";
// The panels below the scene: groups, the selected drone, events.

const PHASES = ["cruise", "avoid", "reform"];
// The reasons of dropped frames, by their letters in `frame.fate`.
const DROP_REASONS = { l: "lost", b: "lost in a burst", r: "out of range", p: "partition", d: "deaf", m: "malformed", q: "waited too long" };

function element(tag, text, name) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (name) made.className = name;
  return made;
}

// A number with so many digits after the point, and without the sign of zero.
function fixed(value, digits) {
  const text = value.toFixed(digits);
  return /^-[0.]+$/.test(text) ? text.slice(1) : text;
}

class Panels {
  constructor(story, scene) {
    this.story = story;
    this.scene = scene;
    this.groups = document.getElementById("groups");
    this.about = document.getElementById("about");
    this.events = document.getElementById("events");
    this.selected = document.getElementById("selected");
    this.listed = 0;
    this.drones = -1;
    this.seek = () => {};
  }

  clear() {
    this.listed = 0;
    this.drones = -1;
    this.events.replaceChildren();
    this.groups.replaceChildren();
    this.about.replaceChildren();
  }

  show(moment, selected) {
    this.choices(moment.x.length, selected);
    this.showGroups(moment);
    this.showDrone(moment, selected);
    this.showEvents(moment.sample.state.t_s);
  }

  choices(drones, selected) {
    if (drones !== this.drones) {
      this.drones = drones;
      this.selected.replaceChildren(new Option("none", ""));
      for (let i = 0; i < drones; i++) this.selected.append(new Option(i, i));
    }
    this.selected.value = selected === null ? "" : selected;
  }

  showGroups(moment) {
    const state = moment.sample.state, groups = new Map();
    state.group.forEach((group, i) => {
      if (!state.alive[i]) return;
      const known = groups.get(group) || { count: 0, leaders: [] };
      known.count++;
      if (state.leads[i]) known.leaders.push(i);
      groups.set(group, known);
    });
    const dead = state.alive.filter(alive => !alive).length;
    const lines = [...groups].sort((a, b) => a[0] < b[0] ? -1 : 1).map(([group, { count, leaders }]) => {
      const line = element("li");
      const dot = element("i");
      dot.style.background = this.scene.colours.of(group);
      const led = leaders.length ? `, led by ${leaders.join(" and ")}` : "";
      line.append(dot, `${group}: ${count}${led}`);
      return line;
    });
    if (dead) lines.push(element("li", `${dead} dead`, "warning"));
    this.groups.replaceChildren(...lines);
  }

  showDrone(moment, i) {
    if (i === null || i >= moment.x.length) {
      this.about.replaceChildren(element("p", "Click a drone, or choose its number, to see its state and the messages that it receives."));
      return;
    }
    const state = moment.sample.state, radio = moment.sample.radio, list = element("dl");
    const row = (name, value) => list.append(element("dt", name), element("dd", value));
    const speed = Math.hypot(moment.vx[i], moment.vy[i]);
    row("state", state.alive[i] ? (state.late[i] ? "alive, late" : "alive") : "dead");
    row("position", `${fixed(moment.x[i], 1)}, ${fixed(moment.y[i], 1)} m`);
    if (moment.z) row("altitude", `${fixed(moment.z[i], 1)} m${Math.abs(state.vz_mps[i]) >= 0.005 ? `, climbs at ${fixed(state.vz_mps[i], 2)} m/s` : ""}`);
    row("speed", `${speed.toFixed(2)} m/s`);
    row("group", state.group[i] + (state.leads[i] ? `, leads ${state.leads[i]}` : ""));
    row("obeys", state.leader[i] === null ? "no leader" : `drone ${state.leader[i]}, round ${state.plan[i][0]} epoch ${state.plan[i][1]}`);
    row("phase", PHASES[state.phase[i]] + (state.route[i] === null ? "" : `, route ${state.route[i]}, place ${state.rank[i]} in the queue`));
    row("energy", `${(moment.sample.energy.drone_j[i] / 1000).toFixed(3)} kJ`);
    row("nearest", this.nearest(moment, i));
    row("radio", `${radio.heard[i] || 0} received, ${radio.dropped_by[i] || 0} dropped since the previous sample`);
    const parts = [list];
    if (moment.heard) parts.push(element("h3", `Hears ${moment.heard.size ? [...moment.heard.keys()].join(", ") : "no drone"}`));
    parts.push(element("h3", "Inbox, newest first"), this.inbox(moment, i));
    this.about.replaceChildren(...parts);
  }

  nearest(moment, i) {
    let least = Infinity, nearest = null;
    for (let k = 0; k < moment.x.length; k++) {
      const d = Math.hypot(moment.x[k] - moment.x[i], moment.y[k] - moment.y[i], moment.z ? moment.z[k] - moment.z[i] : 0);
      if (k !== i && d < least) { least = d; nearest = k; }
    }
    return nearest === null ? "no other drone" : `drone ${nearest}, ${least.toFixed(1)} m`;
  }

  inbox(moment, i) {
    const box = element("div", undefined, "inbox");
    for (const { frame, delivery } of this.story.inbox(i, moment.place, 2, 14)) {
      const reason = delivery === "h" ? "" : `  ${DROP_REASONS[delivery] || "dropped"}`;
      const line = `${frame.t_s.toFixed(2).padStart(7)} s  ${String(frame.source).padStart(3)}  ${frame.kind} ${frame.says}${reason}`;
      box.append(element("div", line, delivery === "h" ? "" : "lost"));
    }
    return box;
  }

  showEvents(t) {
    for (; this.listed < this.story.events.length; this.listed++) {
      const { event, text, severity } = this.story.events[this.listed];
      const line = element("li", undefined, severity === "info" ? "" : severity);
      const stamp = element("time", event.t_s.toFixed(2) + " s");
      const jump = element("button", text);
      jump.title = "Go to this time";
      jump.addEventListener("click", () => this.seek(event.t_s));
      line.append(stamp, jump);
      line.dataset.t = event.t_s;
      this.events.append(line);
    }
    let last = null;
    for (const line of this.events.children) {
      const future = Number(line.dataset.t) > t + 1e-6;
      line.classList.toggle("future", future);
      if (!future) last = line;
    }
    if (last && last !== this.current) {
      this.current = last;
      this.events.scrollTop = last.offsetTop - this.events.offsetTop - this.events.clientHeight + 40;
    }
  }
}
