"use strict";
// Draws the swarm at one time on a canvas. World frame: x to the right, y upwards, metres.

// The colours of Okabe and Ito, which colour-blind people can distinguish; the same as in the plots.
const PALETTE = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#785e3c", "#d55e00"];
// Number of drones above which less is drawn for each drone.
const MANY = 150;
// Least safe distance on the screen at which drones have numbers, pixels.
const NAME_PX = 12;
// Least and greatest size of an arrow, pixels, and its size as a share of the safe distance, so that neighbours do not overlap.
const ARROW_PX = [5, 16], ARROW_SHARE = 0.3;
// Greatest number of points of all whole tracks.
const TRACK_POINTS = 20000;
// Space for the numbers of the axes, pixels.
const GUTTER = { left: 48, bottom: 20 };
// Number of drones up to which danger zones are shown unless the user asks for them.
const ZONES_UP_TO = 20;
// Greatest number of marks that have labels.
const LABELS = 60;
// Length of the trails, s.
const TRAIL_S = 8;

// The colours of groups, in the order in which groups appear. A recording knows the order in advance.
class Colours {
  constructor(groups) { this.order = new Map((groups || []).map((group, place) => [group, place])); }
  of(group) {
    let place = this.order.get(group);
    if (place === undefined) this.order.set(group, place = this.order.size);
    return PALETTE[place % PALETTE.length];
  }
}

class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.colours = new Colours();
    this.facts = null;
    this.view = { x: 0, y: 0, scale: 1 };
    this.fitted = false;
    this.shows = { routes: true, slots: true, zones: true, links: true, drops: true, trails: true, tracks: false, marks: true, names: true, side: true };
    this.readStyle();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.readStyle());
  }

  readStyle() {
    const style = getComputedStyle(document.documentElement);
    const read = name => style.getPropertyValue(name).trim();
    this.ink = { ink: read("--ink"), soft: read("--soft-ink"), grid: read("--grid"), block: read("--block"), bad: read("--bad"),
      grey: read("--grey"), focus: read("--focus") };
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    this.ratio = ratio;
    this.width = width;
    this.height = height;
  }

  // Fits the view to the box [x0, y0, x1, y1], m. If `shrink`, the picture becomes as low as the box allows.
  fit([x0, y0, x1, y1], shrink) {
    const pad = 14, wide = Math.max(x1 - x0, 20), high = Math.max(y1 - y0, 20);
    this.canvas.style.height = "";
    this.resize();
    const across = (this.width - GUTTER.left - 2 * pad) / wide;
    if (shrink) {
      this.canvas.style.height = `${Math.max(200, Math.min(this.height, Math.ceil(high * across + GUTTER.bottom + 2 * pad)))}px`;
      this.resize();
    }
    this.view.scale = Math.max(Math.min(across, (this.height - GUTTER.bottom - 2 * pad) / high), 1e-3);
    this.view.x = (x0 + x1) / 2;
    this.view.y = (y0 + y1) / 2;
  }

  // The middle of the picture without its gutters, pixels.
  get middle() { return [(this.width + GUTTER.left) / 2, (this.height - GUTTER.bottom) / 2]; }
  px(x) { return this.middle[0] + (x - this.view.x) * this.view.scale; }
  py(y) { return this.middle[1] - (y - this.view.y) * this.view.scale; }
  at(px, py) {
    const [mx, my] = this.middle;
    return [this.view.x + (px - mx) / this.view.scale, this.view.y - (py - my) / this.view.scale];
  }

  // Radius of the danger zone at a speed, m.
  danger(v) { const d = this.facts.scene.danger_m; return d[0] + v * (d[1] + v * d[2]); }

  zoom(factor, px, py) {
    const [x, y] = this.at(px, py);
    this.view.scale = Math.min(Math.max(this.view.scale * factor, 0.02), 60);
    const [nx, ny] = this.at(px, py);
    this.view.x += x - nx;
    this.view.y += y - ny;
  }

  // moment: { x, y, vx, vy: arrays, sample, trails }, selected: a number or null.
  draw(moment, selected) {
    this.resize();
    const pen = this.pen;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    this.grid();
    pen.save();
    pen.beginPath();
    pen.rect(GUTTER.left, 0, this.width - GUTTER.left, this.height - GUTTER.bottom);
    pen.clip();
    if (this.facts) this.still();
    if (moment) this.moving(moment, selected);
    pen.restore();
  }

  moving(moment, selected) {
    const many = moment.x.length > MANY;
    if (this.shows.tracks && moment.tracks) this.tracks(moment);
    if (this.shows.trails && moment.trails) this.trails(moment);
    if (this.shows.zones && this.facts) this.zones(moment, many, selected);
    if (this.shows.slots) this.slots(moment);
    if (this.shows.links) this.links(moment, many, selected);
    if (this.shows.drops) this.drops(moment, selected);
    if (this.shows.marks) this.marks(moment, this.pen, x => this.px(x), (_, y) => this.py(y));
    this.drones(moment, many, selected);
  }

  grid() {
    const pen = this.pen;
    const steps = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
    const step = steps.find(s => s * this.view.scale >= 70) || 10000;
    const edge = this.height - GUTTER.bottom;
    const [left, top] = this.at(GUTTER.left, 0), [right, bottom] = this.at(this.width, edge);
    pen.lineWidth = 1;
    pen.strokeStyle = this.ink.grid;
    pen.fillStyle = this.ink.soft;
    pen.font = "11px system-ui,sans-serif";
    pen.textBaseline = "alphabetic";
    pen.beginPath();
    const xs = [], ys = [];
    for (let x = Math.ceil(left / step) * step; x <= right; x += step) xs.push(x);
    for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) ys.push(y);
    for (const x of xs) { pen.moveTo(this.px(x), 0); pen.lineTo(this.px(x), edge + 4); }
    for (const y of ys) { pen.moveTo(GUTTER.left - 4, this.py(y)); pen.lineTo(this.width, this.py(y)); }
    pen.stroke();
    pen.textAlign = "center";
    for (const x of xs) if (this.px(x) < this.width - 20) pen.fillText(x + " m", this.px(x), this.height - 5);
    pen.textAlign = "right";
    for (const y of ys) if (this.py(y) > 8) pen.fillText(y + " m", GUTTER.left - 7, this.py(y) + 4);
  }

  path(points, closed) {
    const pen = this.pen;
    points.forEach(([x, y], i) => i ? pen.lineTo(this.px(x), this.py(y)) : pen.moveTo(this.px(x), this.py(y)));
    if (closed) pen.closePath();
  }

  still() {
    const pen = this.pen;
    pen.fillStyle = this.ink.block;
    pen.beginPath();
    for (const outline of this.facts.outlines) this.path(outline, true);
    pen.fill();
    if (!this.shows.routes) return;
    pen.lineWidth = 1;
    pen.setLineDash([4, 4]);
    pen.strokeStyle = this.ink.grey;
    pen.beginPath();
    for (const set of this.facts.scene.sets) for (const hull of set.hulls_m) this.path(hull, true);
    pen.stroke();
    pen.setLineDash([1, 5]);
    pen.lineWidth = 2;
    pen.strokeStyle = this.ink.focus;
    pen.beginPath();
    for (const set of this.facts.scene.sets) for (const route of set.routes_m) this.path(route, false);
    pen.stroke();
    pen.setLineDash([]);
  }

  byGroup(moment) {
    const groups = new Map();
    const state = moment.sample.state;
    for (let i = 0; i < moment.x.length; i++) {
      const key = state.alive[i] ? state.group[i] : "";
      const members = groups.get(key);
      if (members) members.push(i); else groups.set(key, [i]);
    }
    return groups;
  }

  colour(group) { return group === "" ? this.ink.grey : this.colours.of(group); }

  trails(moment) {
    const pen = this.pen;
    pen.lineWidth = 1.5;
    pen.globalAlpha = 0.5;
    for (const [group, members] of this.byGroup(moment)) {
      pen.strokeStyle = this.colour(group);
      pen.beginPath();
      for (const i of members) {
        moment.trails.forEach((s, k) => k ? pen.lineTo(this.px(s.state.x_m[i]), this.py(s.state.y_m[i]))
          : pen.moveTo(this.px(s.state.x_m[i]), this.py(s.state.y_m[i])));
        pen.lineTo(this.px(moment.x[i]), this.py(moment.y[i]));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  // The whole tracks of all drones, in the colours of their groups.
  tracks(moment) {
    const pen = this.pen, samples = moment.tracks;
    const step = Math.max(1, Math.ceil(samples.length * moment.x.length / TRACK_POINTS));
    const lines = new Map();
    let before = null;
    for (let k = 0; k < samples.length; k = k === samples.length - 1 ? k + 1 : Math.min(k + step, samples.length - 1)) {
      const now = samples[k].state;
      if (before) {
        for (let i = 0; i < now.x_m.length; i++) {
          if (!now.alive[i]) continue;
          let line = lines.get(before.group[i]);
          if (!line) lines.set(before.group[i], line = new Path2D());
          line.moveTo(this.px(before.x_m[i]), this.py(before.y_m[i]));
          line.lineTo(this.px(now.x_m[i]), this.py(now.y_m[i]));
        }
      }
      before = now;
    }
    pen.lineWidth = 1;
    pen.globalAlpha = 0.7;
    for (const [group, line] of lines) { pen.strokeStyle = this.colour(group); pen.stroke(line); }
    pen.globalAlpha = 1;
  }

  // What pilots show: marks and lines, in the colour of the drone that shows them. The same from above and from the side.
  marks(moment, pen, right, up) {
    const shown = moment.sample.shown, state = moment.sample.state;
    if (!shown) return;
    const colour = drone => drone < state.group.length ? this.colour(state.group[drone]) : this.ink.soft;
    const labelled = this.shows.names && shown.marks.length + shown.lines.length <= LABELS;
    pen.lineWidth = 1.6;
    pen.font = "11px system-ui,sans-serif";
    pen.textAlign = "left";
    const label = (text, x, y) => { if (labelled && text) { pen.fillStyle = this.ink.soft; pen.fillText(text, x, y); } };
    for (const line of shown.lines) {
      const [x, y] = [right(line.from_m[0]), up(line.from_m[2], line.from_m[1])], [u, v] = [right(line.to_m[0]), up(line.to_m[2], line.to_m[1])];
      pen.strokeStyle = colour(line.drone);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(u, v);
      pen.stroke();
      label(line.label, (x + u) / 2 + 4, (y + v) / 2 - 3);
    }
    for (const mark of shown.marks) {
      const x = right(mark.at_m[0]), y = up(mark.at_m[2], mark.at_m[1]);
      pen.strokeStyle = colour(mark.drone);
      pen.beginPath();
      pen.moveTo(x, y - 5); pen.lineTo(x + 5, y); pen.lineTo(x, y + 5); pen.lineTo(x - 5, y);
      pen.closePath();
      pen.stroke();
      label(mark.label, x + 8, y + 4);
    }
  }

  zones(moment, many, selected) {
    const pen = this.pen, state = moment.sample.state;
    pen.fillStyle = this.ink.bad;
    pen.globalAlpha = 0.07;
    for (let i = 0; i < moment.x.length; i++) {
      if (!state.alive[i] || (many && i !== selected)) continue;
      const v = Math.hypot(moment.vx[i], moment.vy[i]);
      pen.beginPath();
      pen.arc(this.px(moment.x[i]), this.py(moment.y[i]), this.danger(v) * this.view.scale, 0, 7);
      pen.fill();
    }
    pen.globalAlpha = 1;
    if (many) return;
    // Circles of half the safe distance. They overlap if two drones are closer than the safe distance.
    pen.strokeStyle = this.ink.bad;
    pen.lineWidth = 1;
    pen.beginPath();
    const radius = this.facts.safe_distance_m / 2 * this.view.scale;
    for (let i = 0; i < moment.x.length; i++) {
      if (!state.alive[i]) continue;
      const x = this.px(moment.x[i]), y = this.py(moment.y[i]);
      pen.moveTo(x + radius, y);
      pen.arc(x, y, radius, 0, 7);
    }
    pen.globalAlpha = 0.35;
    pen.stroke();
    pen.globalAlpha = 1;
  }

  slots(moment) {
    const pen = this.pen;
    pen.strokeStyle = this.ink.soft;
    pen.lineWidth = 1;
    pen.beginPath();
    for (const slot of moment.sample.state.slot_m) {
      if (!slot) continue;
      const x = this.px(slot[0]), y = this.py(slot[1]);
      pen.moveTo(x - 4, y); pen.lineTo(x + 4, y);
      pen.moveTo(x, y - 4); pen.lineTo(x, y + 4);
    }
    pen.stroke();
  }

  // Lines from each leader to its followers. For a selected drone, also lines from the drones that it hears.
  links(moment, many, selected) {
    const pen = this.pen, state = moment.sample.state;
    pen.lineWidth = 1;
    pen.strokeStyle = this.ink.soft;
    pen.globalAlpha = many ? 0.15 : 0.4;
    pen.beginPath();
    for (let i = 0; i < moment.x.length; i++) {
      const leader = state.leader[i];
      if (leader === null || leader === i || !state.alive[i] || leader >= moment.x.length) continue;
      pen.moveTo(this.px(moment.x[leader]), this.py(moment.y[leader]));
      pen.lineTo(this.px(moment.x[i]), this.py(moment.y[i]));
    }
    pen.stroke();
    if (selected !== null && moment.heard) {
      pen.strokeStyle = this.ink.focus;
      pen.globalAlpha = 0.8;
      pen.beginPath();
      for (const source of moment.heard.keys()) {
        pen.moveTo(this.px(moment.x[source]), this.py(moment.y[source]));
        pen.lineTo(this.px(moment.x[selected]), this.py(moment.y[selected]));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  // The frames of this sample that were dropped in range. If a drone is selected, only frames to it.
  drops(moment, selected) {
    const pen = this.pen, radio = moment.sample.radio;
    pen.strokeStyle = this.ink.bad;
    pen.lineWidth = 1.2;
    pen.globalAlpha = 0.55;
    pen.setLineDash([3, 4]);
    pen.beginPath();
    for (const frame of radio.frames) {
      for (let k = 0; k < frame.fate.length; k++) {
        const to = radio.receiver === null ? k : radio.receiver;
        if ("h-r".includes(frame.fate[k]) || (selected !== null && to !== selected)) continue;
        pen.moveTo(this.px(moment.x[frame.source]), this.py(moment.y[frame.source]));
        pen.lineTo(this.px(moment.x[to]), this.py(moment.y[to]));
      }
    }
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  drones(moment, many, selected) {
    const pen = this.pen, state = moment.sample.state;
    const gap = this.facts ? this.facts.safe_distance_m : 10;
    const size = Math.min(Math.max(ARROW_SHARE * gap * this.view.scale, many ? 2.5 : ARROW_PX[0]), ARROW_PX[1]);
    for (const [group, members] of this.byGroup(moment)) {
      pen.fillStyle = this.colour(group);
      pen.beginPath();
      for (const i of members) this.arrow(moment, i, size);
      pen.fill();
    }
    pen.lineWidth = 2;
    pen.strokeStyle = this.ink.ink;
    pen.beginPath();
    for (let i = 0; i < moment.x.length; i++) {
      if (!state.leads[i] || !state.alive[i]) continue;
      const x = this.px(moment.x[i]), y = this.py(moment.y[i]);
      pen.moveTo(x + size * 1.5, y);
      pen.arc(x, y, size * 1.5, 0, 7);
    }
    pen.stroke();
    if (selected !== null && selected < moment.x.length) {
      pen.strokeStyle = this.ink.focus;
      pen.lineWidth = 3;
      pen.beginPath();
      pen.arc(this.px(moment.x[selected]), this.py(moment.y[selected]), size * 2, 0, 7);
      pen.stroke();
    }
    // The numbers of two drones at the safe distance must not overlap.
    if (this.shows.names && this.facts.safe_distance_m * this.view.scale > NAME_PX) this.names(moment, size);
  }

  arrow(moment, i, size) {
    const pen = this.pen, x = this.px(moment.x[i]), y = this.py(moment.y[i]);
    const v = Math.hypot(moment.vx[i], moment.vy[i]);
    if (!moment.sample.state.alive[i]) {
      pen.rect(x - size, y - size / 4, 2 * size, size / 2);
      pen.rect(x - size / 4, y - size, size / 2, 2 * size);
      return;
    }
    const c = v > 0.05 ? moment.vx[i] / v : 1, s = v > 0.05 ? -moment.vy[i] / v : 0;
    pen.moveTo(x + 1.3 * size * c, y + 1.3 * size * s);
    pen.lineTo(x - size * c - 0.8 * size * s, y - size * s + 0.8 * size * c);
    pen.lineTo(x - 0.5 * size * c, y - 0.5 * size * s);
    pen.lineTo(x - size * c + 0.8 * size * s, y - size * s - 0.8 * size * c);
    pen.closePath();
  }

  names(moment, size) {
    const pen = this.pen;
    pen.fillStyle = this.ink.ink;
    pen.font = "12px system-ui,sans-serif";
    pen.textAlign = "left";
    for (let i = 0; i < moment.x.length; i++) {
      // The altitude stands beside a drone that is not at the formation's.
      const off = moment.z && Math.abs(moment.z[i] - this.facts.scene.altitude_m) > 0.5;
      const name = off ? `${i}: ${fixed(moment.z[i], 0)} m` : i;
      pen.fillText(name, this.px(moment.x[i]) + size * 1.3 + 2, this.py(moment.y[i]) - size);
    }
  }

  // The number of the drone at a point of the canvas, or null.
  pick(moment, px, py) {
    let best = null, least = 18 * 18;
    for (let i = 0; i < moment.x.length; i++) {
      const d = (this.px(moment.x[i]) - px) ** 2 + (this.py(moment.y[i]) - py) ** 2;
      if (d < least) { least = d; best = i; }
    }
    return best;
  }
}
