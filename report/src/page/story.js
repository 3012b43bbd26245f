"use strict";
// What is known of a run: facts, samples in the order of time, events. Filled at once from a report, bit by bit by a live run.

// A live view of a large swarm forgets its oldest samples beyond so many numbers.
const KEEP = 6e6;

class Story {
  constructor() { this.clear(); }

  clear() {
    this.facts = null;
    this.samples = [];
    this.events = [];
    this.fresh = true;
  }

  get start() { return this.samples.length ? this.samples[0].state.t_s : 0; }
  get end() { return this.samples.length ? this.samples[this.samples.length - 1].state.t_s : 0; }

  // Takes one line of the stream.
  take(line) {
    if (line.facts) {
      this.clear();
      this.facts = line.facts;
    } else if (line.sample) {
      this.samples.push(line.sample);
      const most = Math.max(600, KEEP / (16 * Math.max(1, line.sample.state.x_m.length)));
      if (this.samples.length > most * 1.1) this.samples.splice(0, this.samples.length - most);
    } else if (line.event) {
      this.events.push(line);
    }
  }

  // Place of the last sample at or before t; -1 before the first.
  before(t) {
    let low = 0, high = this.samples.length;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (this.samples[mid].state.t_s <= t + 1e-9) low = mid + 1; else high = mid;
    }
    return low - 1;
  }

  // The swarm at t: positions between the two samples around it, everything else of the earlier one.
  moment(t, trail) {
    if (!this.samples.length) return null;
    const place = Math.max(this.before(t), 0);
    const a = this.samples[place], b = this.samples[Math.min(place + 1, this.samples.length - 1)];
    const span = b.state.t_s - a.state.t_s;
    const share = span > 0 ? Math.min(Math.max((t - a.state.t_s) / span, 0), 1) : 0;
    const mix = (from, to) => share === 0 ? from : from.map((value, i) => value + (to[i] - value) * share);
    const [sa, sb] = [a.state, b.state];
    const moment = { x: mix(sa.x_m, sb.x_m), y: mix(sa.y_m, sb.y_m), vx: mix(sa.vx_mps, sb.vx_mps), vy: mix(sa.vy_mps, sb.vy_mps),
      sample: a, place };
    if (trail && sa.x_m.length <= MANY) {
      const first = Math.max(this.before(t - TRAIL_S), 0);
      const step = Math.max(1, Math.floor((place - first) / 80));
      moment.trails = [];
      for (let k = first; k <= place; k += step) moment.trails.push(this.samples[k]);
    }
    return moment;
  }

  // Messages to a drone within the last `span` seconds before a place, the newest first; those heard and those not.
  inbox(drone, place, span, most) {
    const found = [];
    const until = this.samples[place] ? this.samples[place].state.t_s - span : 0;
    for (let k = place; k >= 0 && this.samples[k].state.t_s >= until && found.length < most; k--) {
      const radio = this.samples[k].radio;
      for (let f = radio.frames.length - 1; f >= 0 && found.length < most; f--) {
        const frame = radio.frames[f];
        const fate = radio.receiver === null ? frame.fate[drone] : radio.receiver === drone ? frame.fate[0] : "-";
        if (fate && fate !== "-") found.push({ frame, fate });
      }
    }
    return found;
  }

  // Whom a drone has heard lately: source and number of messages.
  heard(drone, place) {
    const from = new Map();
    for (const { frame, fate } of this.inbox(drone, place, 0.35, 2000)) {
      if (fate === "h") from.set(frame.source, (from.get(frame.source) || 0) + 1);
    }
    return new Map([...from].sort((a, b) => a[0] - b[0]));
  }

  // What is worth seeing: obstacles and all that was flown, m.
  box() {
    let box = [Infinity, Infinity, -Infinity, -Infinity];
    const add = (x, y) => { box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)]; };
    if (this.facts) for (const outline of this.facts.outlines) for (const [x, y] of outline) add(x, y);
    const step = Math.max(1, Math.floor(this.samples.length / 100));
    for (let k = 0; k < this.samples.length; k += step) {
      const s = this.samples[k].state;
      for (let i = 0; i < s.x_m.length; i++) add(s.x_m[i], s.y_m[i]);
    }
    return box[0] > box[2] ? [-50, -50, 50, 50] : box;
  }
}
