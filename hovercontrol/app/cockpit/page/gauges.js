// Gauges: a number with its unit, a bar from zero, and a mark where the law wants it to be.
import { number, shown, wrap } from "/page/units.js";

// name, label, unit, ends of the bar in SI, digits, the reference that is marked
const MOTION = [
  ["u", "surge u", "m/s", -1.6, 1.6, 2, "surge_ref"],
  ["v", "sway v", "m/s", -1.6, 1.6, 2, null],
  ["r", "yaw rate r", "rad/s", -6, 6, 0, "yaw_rate_ref"],
  ["psi", "heading ψ", "rad", -Math.PI, Math.PI, 0, "heading_ref"],
  ["speed", "speed", "m/s", 0, 2, 2, null],
];

export class Gauges {
  constructor(box) {
    this.box = box;
    this.all = [];
  }

  build(about) {
    const commands = about.inputs.map((i) => {
      const end = i.unit === "rad" ? Math.PI / 2 : i.full;
      return [i.name, i.name.replace("_", " "), i.unit, i.lower === 0 ? 0 : -end, end, i.unit === "rad" ? 0 : 2, null];
    });
    const energy = about.energy ? [["energy", "energy", "J", 0, 6, 2, null], ["distance", "to the goal", "m", 0, 5, 2, null]] : [];
    this.box.replaceChildren();
    this.all = [...MOTION, ...commands, ...energy].map((row) => this.make(...row));
  }

  make(name, label, unit, low, high, digits, reference) {
    const { text, factor } = shown(unit);
    const root = document.createElement("div");
    root.className = "gauge";
    root.innerHTML = '<div class="top"><span></span></div><div class="value"><output></output> <small></small></div>'
      + '<div class="bar"><i></i><b hidden></b></div>';
    root.querySelector("span").textContent = label;
    root.querySelector("small").textContent = text;
    const output = root.querySelector("output");
    output.setAttribute("aria-label", label);
    output.setAttribute("aria-live", "off");
    const part = (value) => 100 * Math.min(1, Math.max(0, (value - low) / (high - low)));
    const zero = part(0);
    root.querySelector(".bar").style.setProperty("--zero", `${zero}%`);
    this.box.append(root);
    return { name, reference, factor, digits, output, root, part, zero, fill: root.querySelector("i"), mark: root.querySelector("b") };
  }

  show(signals) {
    const seen = { ...signals };
    for (const [name] of MOTION) { // in the real loop: what the ground station knows
      if (`${name}_told_received` in signals) seen[name] = signals[`${name}_told_received`];
    }
    seen.speed = Math.hypot(seen.u, seen.v);
    for (const g of this.all) {
      g.root.hidden = ["distance", "energy"].includes(g.name) && !(g.name in seen);
      const raw = seen[g.name];
      const angle = g.name === "psi" || g.name === "rudder";
      const value = angle && Number.isFinite(raw) ? wrap(raw) : raw;
      g.output.textContent = number(value * g.factor, g.digits);
      const end = Number.isFinite(value) ? g.part(value) : g.zero;
      g.fill.style.left = `${Math.min(end, g.zero)}%`;
      g.fill.style.width = `${Math.abs(end - g.zero)}%`;
      const wanted = seen[g.reference];
      g.mark.hidden = !Number.isFinite(wanted);
      if (!g.mark.hidden) g.mark.style.left = `${g.part(angle ? wrap(wanted) : wanted)}%`;
    }
  }
}
