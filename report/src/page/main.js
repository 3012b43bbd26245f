"use strict";
// The player: connects story, scene and panels, plays a recording, and follows a live run.

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const byId = id => document.getElementById(id);

class Player {
  constructor() {
    this.story = new Story();
    this.scene = new Scene(byId("scene"));
    this.side = new Side(byId("side"), this.scene);
    this.panels = new Panels(this.story, this.scene);
    this.key = new Key(this.scene.shows);
    // What takes part in the fitted box, or changes the size of the picture.
    this.key.changed = name => { if (!this.scene.fitted && ["zones", "routes", "key", "side"].includes(name)) this.fit(); };
    this.t = 0;
    this.playing = false;
    this.live = false;
    this.selected = null;
    this.frames = 0;
    this.last = null;
    this.shown = 0;
    this.select = drone => {};
    this.controls();
    this.pointer();
    requestAnimationFrame(now => this.frame(now));
  }

  controls() {
    const speed = byId("speed");
    speed.append(new Option("live", "live"), ...SPEEDS.map(s => new Option(s + " ×", s)));
    speed.value = 1;
    speed.addEventListener("change", () => { this.live = speed.value === "live"; if (this.live) this.play(true); });
    byId("play").addEventListener("click", () => this.play(!this.playing));
    byId("time").addEventListener("input", event => this.seek(Number(event.target.value)));
    byId("fit").addEventListener("click", () => this.fit());
    byId("selected").addEventListener("change", event => this.choose(event.target.value === "" ? null : Number(event.target.value)));
    this.panels.seek = t => this.seek(t);
    document.addEventListener("keydown", event => this.press(event));
    window.addEventListener("resize", () => { if (!this.scene.fitted) this.fit(); });
  }

  press(event) {
    if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName)) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === " ") this.play(!this.playing);
    else if (event.key === "f") this.fit();
    else if (event.key === "k") this.key.open(this.key.aside.hidden);
    else if (event.key === "Escape") this.choose(null);
    else if (step) this.seek(this.t + step * (event.shiftKey ? 5 : 0.5));
    else return;
    event.preventDefault();
  }

  pointer() {
    const canvas = byId("scene"), held = new Map();
    let moved = 0;
    const place = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", event => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, place(event)); moved = 0; });
    canvas.addEventListener("pointermove", event => {
      const from = held.get(event.pointerId);
      if (!from) return;
      const to = place(event), other = [...held].find(([id]) => id !== event.pointerId);
      if (other) {
        const gap = p => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]);
        this.scene.zoom(gap(to) / Math.max(gap(from), 1), (to[0] + other[1][0]) / 2, (to[1] + other[1][1]) / 2);
      } else {
        this.scene.view.x -= (to[0] - from[0]) / this.scene.view.scale;
        this.scene.view.y += (to[1] - from[1]) / this.scene.view.scale;
      }
      moved += Math.hypot(to[0] - from[0], to[1] - from[1]);
      this.scene.fitted = true;
      held.set(event.pointerId, to);
    });
    const up = event => {
      if (held.delete(event.pointerId) && event.type === "pointerup" && moved < 5 && this.now) this.choose(this.scene.pick(this.now, ...place(event)));
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.scene.fitted = true;
      this.scene.zoom(Math.exp(-event.deltaY * 0.0015), ...place(event));
    }, { passive: false });
  }

  play(on) {
    if (on && !this.live && this.t >= this.story.end - 1e-6) this.t = this.story.start;
    this.playing = on;
    byId("play").textContent = on ? "Pause" : "Play";
    byId("play").setAttribute("aria-pressed", on);
  }

  seek(t) {
    this.t = Math.min(Math.max(t, this.story.start), this.story.end);
    if (this.live) { this.live = false; byId("speed").value = 1; this.play(false); }
  }

  fit() {
    this.fitBox();
    byId("follow").checked = false;
    this.scene.fitted = false;
  }

  // A recorded flight gets a picture of its own shape. A live one grows, and its picture must not.
  fitBox() {
    this.scene.fit(this.story.box(this.scene.shows, v => this.scene.danger(v)), !this.open);
  }

  choose(drone) {
    this.selected = drone;
    this.shown = 0;
    this.select(drone);
  }

  advance(now) {
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.25);
    this.last = now;
    if (!this.playing) return;
    if (this.live) this.t = this.story.end;
    else {
      this.t = Math.min(this.t + passed * Number(byId("speed").value), this.story.end);
      if (this.t >= this.story.end && !this.open) this.play(false);
    }
  }

  frame(now) {
    this.advance(now);
    this.t = Math.max(this.t, this.story.start);
    const moment = this.now = this.story.moment(this.t, this.scene.shows.trails, this.scene.shows.tracks);
    if (moment && this.selected !== null && this.selected < moment.x.length) moment.heard = this.story.heard(this.selected, moment.place);
    if (moment && byId("follow").checked) this.follow(moment);
    this.scene.draw(moment, this.selected);
    this.side.draw(moment, this.story, this.scene.shows.side && Side.isOfUse(this.story));
    const slider = byId("time");
    slider.min = this.story.start;
    slider.max = this.story.end;
    if (document.activeElement !== slider || this.playing) slider.value = this.t;
    byId("clock").textContent = this.t.toFixed(1) + " s";
    // The text of the panels is updated ten times per second.
    if (moment && now - this.shown > 100) { this.shown = now; this.panels.show(moment, this.selected); this.offer(); }
    this.frames++;
    requestAnimationFrame(then => this.frame(then));
  }

  // Lists what only some runs have.
  offer() {
    this.key.offer("marks", this.story.shown);
    this.key.offer("side", Side.isOfUse(this.story));
  }

  follow(moment) {
    const state = moment.sample.state, view = this.scene.view;
    if (this.selected !== null && this.selected < moment.x.length) {
      [view.x, view.y] = [moment.x[this.selected], moment.y[this.selected]];
      return;
    }
    let x = 0, y = 0, count = 0;
    moment.x.forEach((_, i) => { if (state.alive[i]) { x += moment.x[i]; y += moment.y[i]; count++; } });
    if (count) [view.x, view.y] = [x / count, y / count];
  }

  take(line) {
    if (line.facts) {
      this.panels.clear();
      this.scene.colours = new Colours(line.facts.groups);
      this.key.set("zones", line.facts.drones <= ZONES_UP_TO);
      this.scene.fitted = false;
      this.t = 0;
    }
    this.story.take(line);
    if (line.facts) { this.scene.facts = line.facts; this.fit(); }
    if (line.sample) for (const group of line.sample.state.group) this.scene.colours.of(group);
    if (line.status !== undefined) byId("status").textContent = line.status;
    // Refits the view to a live swarm, which flies out of it, unless the user has moved the view.
    if (line.sample && this.live && !this.scene.fitted && this.story.samples.length % 20 === 1) this.fitBox();
  }
}

// Unpacks the recording in the page: lines of JSON, deflated, in Base64.
async function unpack(text) {
  const bytes = Uint8Array.from(atob(text.trim()), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return (await new Response(stream).text()).split("\n").filter(line => line).map(line => JSON.parse(line));
}

// Applies an address such as `#t=55&drone=3`, which selects a time and a drone.
function applyHash() {
  const words = new URLSearchParams(location.hash.slice(1));
  if (words.has("t")) player.seek(Number(words.get("t")) || 0);
  if (words.has("drone")) player.choose(Number(words.get("drone")) || 0);
}

// Follows a live run, and the next one after its end.
function listen(player) {
  const socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
  const hint = byId("hint");
  socket.onopen = () => { hint.hidden = true; };
  socket.onmessage = message => message.data.split("\n").forEach(line => line && player.take(JSON.parse(line)));
  player.select = drone => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ select: drone })); };
  socket.onclose = () => {
    hint.hidden = player.story.samples.length > 0;
    hint.textContent = "skein view has ended.";
    byId("status").textContent = "disconnected";
    player.open = false;
  };
}

const player = window.player = new Player();
const data = byId("data");
if (data) {
  byId("speed").options[0].remove();
  unpack(data.textContent).then(lines => { lines.forEach(line => player.take(line)); player.fit(); player.t = player.story.start; applyHash(); },
    error => { byId("hint").hidden = false; byId("hint").textContent = "The replay cannot be shown: " + error.message; });
} else {
  player.live = player.open = true;
  byId("speed").value = "live";
  player.play(true);
  listen(player);
}
