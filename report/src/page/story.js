"use strict";
// The data of a run: facts, samples in order of time, events. A recorded run is loaded at once, a live run line by line.

// Largest number of values that a live view keeps. Beyond it, the oldest samples are removed.
const MAX_VALUES = 6e6;

class Story {
  constructor() { this.clear(); }

  clear() {
    this.facts = null;
    this.samples = [];
    this.events = [];
    // Least and greatest altitude of a drone, m, and whether a pilot showed something.
    this.low = Infinity;
    this.high = -Infinity;
    this.shown = false;
  }

  get start() { return this.samples.length ? this.samples[0].state.t_s : 0; }
  get end() { return this.samples.length ? this.samples[this.samples.length - 1].state.t_s : 0; }

  // Takes one line of the data.
  take(line) {
    if (line.facts) {
      this.clear();
      this.facts = line.facts;
    } else if (line.sample) {
      this.samples.push(line.sample);
      this.shown ||= Boolean(line.sample.shown);
      for (const z of line.sample.state.z_m) { if (z < this.low) this.low = z; if (z > this.high) this.high = z; }
      const limit = Math.max(600, MAX_VALUES / (16 * Math.max(1, line.sample.state.x_m.length)));
      if (this.samples.length > limit * 1.1) this.samples.splice(0, this.samples.length - limit);
    } else if (line.event) {
      this.events.push(line);
    }
  }

  // Index of the last sample at or before t; -1 if there is none.
  before(t) {
    let low = 0, high = this.samples.length;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (this.samples[mid].state.t_s <= t + 1e-9) low = mid + 1; else high = mid;
    }
    return low - 1;
  }

  // The swarm at t. Positions and velocities are interpolated between two samples; all else is from the earlier sample.
  moment(t, trail, tracks) {
    if (!this.samples.length) return null;
    const place = Math.max(this.before(t), 0);
    const a = this.samples[place], b = this.samples[Math.min(place + 1, this.samples.length - 1)];
    const span = b.state.t_s - a.state.t_s;
    const share = span > 0 ? Math.min(Math.max((t - a.state.t_s) / span, 0), 1) : 0;
    const mix = (from, to) => share === 0 ? from : from.map((value, i) => value + (to[i] - value) * share);
    const [sa, sb] = [a.state, b.state];
    const moment = { x: mix(sa.x_m, sb.x_m), y: mix(sa.y_m, sb.y_m), z: sa.z_m.length ? mix(sa.z_m, sb.z_m) : null, vx: mix(sa.vx_mps, sb.vx_mps), vy: mix(sa.vy_mps, sb.vy_mps),
      sample: a, place };
    if (trail && sa.x_m.length <= MANY) {
      const first = Math.max(this.before(t - TRAIL_S), 0);
      const step = Math.max(1, Math.floor((place - first) / 80));
      moment.trails = [];
      for (let k = first; k <= place; k += step) moment.trails.push(this.samples[k]);
    }
    if (tracks) moment.tracks = this.samples;
    return moment;
  }

  // The frames sent to a drone in the last `span` seconds before the sample at `place`, newest first, at most `most` of
  // them: delivered and dropped ones.
  inbox(drone, place, span, most) {
    const found = [];
    const until = this.samples[place] ? this.samples[place].state.t_s - span : 0;
    for (let k = place; k >= 0 && this.samples[k].state.t_s >= until && found.length < most; k--) {
      const radio = this.samples[k].radio;
      for (let f = radio.frames.length - 1; f >= 0 && found.length < most; f--) {
        const frame = radio.frames[f];
        const delivery = radio.receiver === null ? frame.fate[drone] : radio.receiver === drone ? frame.fate[0] : "-";
        if (delivery && delivery !== "-") found.push({ frame, delivery });
      }
    }
    return found;
  }

  // The drones whose messages a drone received in the last 0.35 s: a map from sender to number of messages.
  heard(drone, place) {
    const from = new Map();
    for (const { frame, delivery } of this.inbox(drone, place, 0.35, 2000)) {
      if (delivery === "h") from.set(frame.source, (from.get(frame.source) || 0) + 1);
    }
    return new Map([...from].sort((a, b) => a[0] - b[0]));
  }

  // The box around obstacles and tracks, and around routes and discs if they are shown: [x0, y0, x1, y1], m. `radius` gives
  // the radius of the disc around a drone at a speed, m.
  box(shows, radius) {
    let box = [Infinity, Infinity, -Infinity, -Infinity];
    const add = (x, y) => { box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)]; };
    if (this.facts) for (const outline of this.facts.outlines) for (const [x, y] of outline) add(x, y);
    if (this.facts && shows.routes) for (const set of this.facts.scene.sets) {
      for (const line of [...set.hulls_m, ...set.routes_m]) for (const [x, y] of line) add(x, y);
    }
    const step = Math.max(1, Math.floor(this.samples.length / 100));
    for (let k = 0; k < this.samples.length; k += step) {
      const s = this.samples[k].state;
      for (let i = 0; i < s.x_m.length; i++) {
        const r = shows.zones && s.alive[i] ? radius(Math.hypot(s.vx_mps[i], s.vy_mps[i])) : 0;
        add(s.x_m[i] - r, s.y_m[i] - r);
        add(s.x_m[i] + r, s.y_m[i] + r);
      }
    }
    return box[0] > box[2] ? [-50, -50, 50, 50] : box;
  }
}
