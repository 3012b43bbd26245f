"use strict";
// The side view: altitude over x, below the view from above and with the same scale along x.

class Side {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.scene = scene;
    this.pen = canvas.getContext("2d");
  }

  // Whether there is anything to see: an altitude other than the formation's, or an obstacle with a floor or a top.
  static isOfUse(story) {
    if (!story.facts) return false;
    const tall = outline => outline.top_m !== undefined || outline.floor_m > 0;
    const level = story.facts.scene.altitude_m;
    return story.facts.obstacles.some(tall) || story.high > level + 0.5 || story.low < level - 0.5;
  }

  draw(moment, story, shown) {
    if (this.canvas.hidden === shown) this.canvas.hidden = !shown;
    if (!shown || !moment || !moment.z) return;
    const { canvas, pen, scene } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const tops = story.facts.obstacles.flatMap(outline => [outline.top_m, outline.floor_m]).filter(m => m !== undefined);
    const top = Math.max(story.high, story.facts.scene.altitude_m, ...tops) * 1.12 + 2, bottom = Math.min(story.low, 0);
    const pz = z => 6 + (height - 14) * (top - z) / (top - bottom);
    const px = x => scene.px(x);
    this.grid(pz, top, bottom, width);
    pen.save();
    pen.beginPath();
    pen.rect(GUTTER.left, 0, width, height);
    pen.clip();
    this.obstacles(story.facts, px, pz, top, bottom);
    if (scene.shows.marks) scene.marks(moment, pen, px, z => pz(z));
    this.drones(moment, px, pz);
    pen.restore();
  }

  grid(pz, top, bottom, width) {
    const pen = this.pen, ink = this.scene.ink;
    const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find(s => (top - bottom) / s <= 4) || 2000;
    pen.strokeStyle = ink.grid;
    pen.fillStyle = ink.soft;
    pen.lineWidth = 1;
    pen.font = "11px system-ui,sans-serif";
    pen.textAlign = "right";
    pen.beginPath();
    for (let z = Math.ceil(bottom / step) * step; z <= top; z += step) {
      pen.moveTo(GUTTER.left - 4, pz(z));
      pen.lineTo(width, pz(z));
      pen.fillText(z + " m", GUTTER.left - 7, Math.max(pz(z) + 4, 10));
    }
    pen.stroke();
    pen.textAlign = "left";
    pen.fillText("altitude", GUTTER.left + 6, 14);
  }

  obstacles(facts, px, pz, top, bottom) {
    const pen = this.pen;
    pen.fillStyle = this.scene.ink.block;
    facts.outlines.forEach((outline, i) => {
      const xs = outline.map(([x]) => x), { floor_m, top_m } = facts.obstacles[i];
      const [left, right] = [px(Math.min(...xs)), px(Math.max(...xs))];
      const [high, low] = [pz(top_m === undefined ? top : top_m), pz(floor_m === undefined ? bottom : floor_m)];
      pen.globalAlpha = top_m === undefined ? 0.5 : 1;
      pen.fillRect(left, high, Math.max(right - left, 2), low - high);
    });
    pen.globalAlpha = 1;
  }

  drones(moment, px, pz) {
    const pen = this.pen, scene = this.scene, state = moment.sample.state;
    const size = moment.x.length > MANY ? 2.5 : 6;
    for (const [group, members] of scene.byGroup(moment)) {
      pen.fillStyle = scene.colour(group);
      pen.beginPath();
      for (const i of members) {
        const x = px(moment.x[i]), y = pz(moment.z[i]), vz = state.vz_mps[i] || 0, v = Math.hypot(moment.vx[i], vz);
        const c = v > 0.05 ? moment.vx[i] / v : 1, s = v > 0.05 ? -vz / v : 0;
        pen.moveTo(x + 1.3 * size * c, y + 1.3 * size * s);
        pen.lineTo(x - size * c - 0.8 * size * s, y - size * s + 0.8 * size * c);
        pen.lineTo(x - 0.5 * size * c, y - 0.5 * size * s);
        pen.lineTo(x - size * c + 0.8 * size * s, y - size * s - 0.8 * size * c);
        pen.closePath();
      }
      pen.fill();
    }
  }
}
