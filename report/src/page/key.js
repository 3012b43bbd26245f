"use strict";
// The key: every sign of the picture, and the switches of those that can be hidden.

// The switch, the sign as SVG (34 by 18), and what it means. Without a switch, the sign is always shown.
const arrow = (x, colour) => `<path d="M${x + 9} 9L${x - 6} 14.5L${x - 3} 9L${x - 6} 3.5Z" fill="${colour}"/>`;
const SIGNS = [
  [null, arrow(8, PALETTE[0]) + arrow(25, PALETTE[1]), "drones, in the colours of their groups"],
  [null, arrow(16, PALETTE[0]) + `<circle cx="17" cy="9" r="8" fill="none" stroke="var(--ink)" stroke-width="2"/>`, "leader of a group"],
  [null, `<path d="M10 9H24M17 2V16" stroke="var(--grey)" stroke-width="4"/>`, "dead drone"],
  [null, `<circle cx="17" cy="9" r="7" fill="none" stroke="var(--focus)" stroke-width="3"/>`, "selected drone"],
  [null, `<path d="M8 2H26V16H8Z" fill="var(--block)"/>`, "obstacle"],
  ["names", `<text x="17" y="14" text-anchor="middle" font-size="13" fill="var(--ink)">3</text>`, "numbers"],
  ["trails", `<path d="M2 14Q14 14 20 9T32 5" fill="none" stroke="${PALETTE[0]}" stroke-width="1.5" opacity=".6"/>`, "tracks of the last 8 s"],
  ["tracks", `<path d="M1 14Q12 15 17 9T33 4" fill="none" stroke="${PALETTE[1]}" stroke-width="1"/>`, "whole tracks"],
  ["zones", `<circle cx="17" cy="9" r="8.5" fill="var(--bad)" opacity=".15"/><circle cx="17" cy="9" r="4.5" fill="none" stroke="var(--bad)" opacity=".6"/>`,
    "danger zone; circles that touch: safe distance"],
  ["links", `<path d="M2 15L32 3" stroke="var(--soft-ink)" opacity=".7"/>`, "leader to follower; blue: heard by the selected drone"],
  ["drops", `<path d="M2 15L32 3" stroke="var(--bad)" stroke-dasharray="3 4"/>`, "frames just lost"],
  ["slots", `<path d="M12 9H22M17 4V14" stroke="var(--soft-ink)"/>`, "slots of the formation"],
  ["routes", `<path d="M2 5H32" stroke="var(--focus)" stroke-width="2" stroke-dasharray="1 5"/><path d="M2 13H32" stroke="var(--grey)" stroke-dasharray="4 4"/>`,
    "routes; obstacles with their clearance"],
  ["marks", `<path d="M9 4L14 9L9 14L4 9Z" fill="none" stroke="${PALETTE[2]}" stroke-width="1.6"/><path d="M18 14L32 4" stroke="${PALETTE[2]}" stroke-width="1.6"/>`,
    "marks and lines of pilots"],
  ["side", `<path d="M3 15H31M8 15V7H14V15" stroke="var(--grey)" fill="none"/>${arrow(22, PALETTE[0])}`, "side view: altitude"],
];

class Key {
  constructor(shows) {
    this.shows = shows;
    this.boxes = {};
    this.lines = {};
    for (const [name, sign, meaning] of SIGNS) document.getElementById("signs").append(this.line(name, sign, meaning));
    this.aside = document.getElementById("key");
    this.button = document.getElementById("open-key");
    this.button.addEventListener("click", () => this.open(this.aside.hidden));
    this.changed = () => {};
    this.open(window.innerWidth >= 900);
  }

  line(name, sign, meaning) {
    const line = element("li"), holder = element(name ? "label" : "span", undefined, name ? "" : "plain");
    const picture = element("span");
    picture.innerHTML = `<svg viewBox="0 0 34 18" aria-hidden="true">${sign}</svg>`;
    if (name) {
      const box = this.boxes[name] = element("input");
      box.type = "checkbox";
      box.id = "show-" + name;
      box.addEventListener("change", () => { this.set(name, box.checked); this.changed(name); });
      holder.append(box);
      this.lines[name] = line;
    }
    holder.append(picture.firstChild, element("span", meaning));
    line.append(holder);
    if (name) this.set(name, this.shows[name], line);
    return line;
  }

  // Switches a sign.
  set(name, on) {
    this.shows[name] = on;
    this.boxes[name].checked = on;
    this.lines[name].classList.toggle("off", !on);
  }

  // Lists a sign only if the run has something of the kind.
  offer(name, offered) {
    if (this.lines[name].hidden === offered) this.lines[name].hidden = !offered;
  }

  open(on) {
    this.aside.hidden = !on;
    this.button.setAttribute("aria-expanded", on);
    if (this.changed) this.changed("key");
  }
}
