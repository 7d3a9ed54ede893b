// The craft from above: earth frame with x to the right and y up, as the package has it.

const TRAIL_STEP = 0.03; // metres between two points of the trail
const TRAIL_LENGTH = 4000;

export class CraftMap {
  constructor(canvas, { onGoal }) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.center = [0, 0];
    this.scale = 80; // pixels per metre
    this.follow = true;
    this.picksGoal = false;
    this.about = null;
    this.onGoal = onGoal;
    this.onFollow = () => {};
    this.trail = [];
    this.drawn = 0;
    this.pointers = new Map();
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.readColors());
    this.readColors();
    this.resize();
    this.listen();
  }

  readColors() {
    const style = getComputedStyle(document.documentElement);
    const names = ["grid", "axis", "soft", "ink", "hull", "trail", "thrust", "rudder", "goal", "air"];
    this.color = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = devicePixelRatio || 1;
    this.size = [clientWidth, clientHeight];
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  zoom(factor) {
    this.scale = Math.min(600, Math.max(8, this.scale * factor));
  }

  setFollow(on) {
    this.follow = on;
    this.onFollow(on);
  }

  toScreen(x, y) {
    return [this.size[0] / 2 + (x - this.center[0]) * this.scale, this.size[1] / 2 - (y - this.center[1]) * this.scale];
  }

  toEarth(px, py) {
    return [this.center[0] + (px - this.size[0] / 2) / this.scale, this.center[1] - (py - this.size[1] / 2) / this.scale];
  }

  listen() {
    const at = (event) => [event.offsetX, event.offsetY];
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, at(event));
      this.moved = this.pointers.size > 1 ? 99 : 0;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const before = this.pointers.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      this.pointers.set(event.pointerId, now);
      this.moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
      if (others.length) {
        const gap = (place) => Math.hypot(place[0] - others[0][0], place[1] - others[0][1]);
        this.zoom(Math.max(gap(now), 1) / Math.max(gap(before), 1));
      } else if (this.moved > 6) {
        if (this.follow) this.setFollow(false);
        this.center = [this.center[0] - (now[0] - before[0]) / this.scale, this.center[1] + (now[1] - before[1]) / this.scale];
      }
    });
    const up = (event) => {
      if (!this.pointers.delete(event.pointerId) || event.type === "pointercancel") return;
      if (this.moved <= 6 && this.picksGoal) this.onGoal(...this.toEarth(...at(event)));
    };
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("pointercancel", up);
    this.canvas.addEventListener("keydown", (event) => {
      const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
      if (factor) this.zoom(factor);
    });
  }

  clearTrail() {
    this.trail = [];
  }

  addToTrail(signals) {
    const last = this.trail.at(-1);
    if (last && Math.hypot(signals.x - last[0], signals.y - last[1]) < TRAIL_STEP) return;
    this.trail.push([signals.x, signals.y]);
    if (this.trail.length > TRAIL_LENGTH) this.trail.shift();
  }

  draw(signals, law, path = null) {
    const { context: c, size } = this;
    if (this.follow) this.center = [signals.x, signals.y];
    c.clearRect(0, 0, ...size);
    this.grid();
    this.line(path ?? this.trail, this.color.trail, 1.5);
    if (law === "goal" && "goal_x_ref" in signals) this.goal(signals);
    if ("heading_ref" in signals) this.heading(signals);
    this.estimate(signals);
    this.craft(signals);
    this.wind(signals);
    this.drawn += 1;
  }

  grid() {
    const { context: c, size, color } = this;
    const rough = 70 / this.scale;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5].find((k) => k * power >= rough) ?? 10);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const [left, top] = this.toEarth(0, 0);
    const [right, bottom] = this.toEarth(...size);
    const narrow = size[0] < 640; // the legend has two lines
    c.lineWidth = 1;
    c.font = "12px system-ui, sans-serif";
    const rule = (value, vertical) => {
      const [px, py] = this.toScreen(value, value).map((p) => Math.round(p) + 0.5);
      c.strokeStyle = Math.abs(value) < step / 2 ? color.axis : color.grid;
      c.beginPath();
      vertical ? (c.moveTo(px, 0), c.lineTo(px, size[1])) : (c.moveTo(0, py), c.lineTo(size[0], py));
      c.stroke();
      const text = (Math.abs(value) < step / 2 ? 0 : value).toFixed(digits).replace("-", "−");
      c.fillStyle = color.soft;
      c.textAlign = vertical ? "center" : "left";
      if (vertical && px > 50 && px < size[0] - 60) c.fillText(text, px, size[1] - 6);
      if (!vertical && py > (narrow ? 66 : 50) && py < size[1] - 26) c.fillText(text, 5, py - 3);
    };
    for (let k = Math.ceil(left / step); k * step <= right; k += 1) rule(k * step, true);
    for (let k = Math.ceil(bottom / step); k * step <= top; k += 1) rule(k * step, false);
    c.textAlign = "right";
    c.fillText("x in m", size[0] - 8, size[1] - 6);
    c.textAlign = "left";
    c.fillText("y in m", 5, narrow ? 58 : 42);
  }

  line(points, color, width) {
    const c = this.context;
    c.strokeStyle = color;
    c.lineWidth = width;
    c.lineJoin = "round";
    c.beginPath();
    points.forEach(([x, y], k) => (k ? c.lineTo(...this.toScreen(x, y)) : c.moveTo(...this.toScreen(x, y))));
    c.stroke();
  }

  arrow(from, to, color, width) {
    const c = this.context;
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (length < 2) return;
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
    const head = Math.min(10, length * 0.6);
    c.strokeStyle = c.fillStyle = color;
    c.lineWidth = width;
    c.beginPath();
    c.moveTo(...from);
    c.lineTo(to[0] - head * 0.7 * Math.cos(angle), to[1] - head * 0.7 * Math.sin(angle));
    c.stroke();
    c.beginPath();
    c.moveTo(...to);
    for (const side of [2.7, -2.7]) c.lineTo(to[0] + head * Math.cos(angle + side), to[1] + head * Math.sin(angle + side));
    c.fill();
  }

  craft(signals) {
    const { context: c, color, about } = this;
    const arm = about?.arm ?? 0.2;
    const cos = Math.cos(signals.psi);
    const sin = Math.sin(signals.psi);
    const place = (a, b) => this.toScreen(signals.x + cos * a - sin * b, signals.y + sin * a + cos * b);
    const path = this.pathOf(place);
    this.hull(path, arm);
    c.fillStyle = color.hull;
    c.strokeStyle = color.ink;
    c.lineWidth = 1.5;
    c.fill();
    c.stroke();
    c.beginPath();
    c.arc(...place(0, 0), 2.5, 0, 7);
    c.fillStyle = color.ink;
    c.fill();
    const full = (name) => about?.inputs.find((i) => i.name === name)?.full || 1;
    const force = (at, angle, part, ink) => {
      const length = 2 * arm * Math.max(-2, Math.min(2, part)); // a law may ask for far more than full stick
      this.arrow(place(...at), place(at[0] + length * Math.cos(angle), at[1] + length * Math.sin(angle)), ink, 3);
    };
    if (Number.isFinite(signals.rudder)) {
      path([-arm, 0], [-arm - 0.55 * arm * Math.cos(signals.rudder), -0.55 * arm * Math.sin(signals.rudder)]);
      c.strokeStyle = color.rudder;
      c.lineWidth = 4;
      c.stroke();
      force([-arm, 0], signals.rudder, (signals.thrust || 0) / full("thrust"), color.thrust);
    }
    for (const fan of about?.fans ?? []) {
      force([fan.x, fan.y], fan.direction, (signals[fan.name] || 0) / full(fan.name), color.thrust);
    }
  }

  pathOf(place) {
    return (...points) => {
      this.context.beginPath();
      points.forEach((p, k) => (k ? this.context.lineTo(...place(...p)) : this.context.moveTo(...place(...p))));
    };
  }

  hull(path, arm) {
    const half = 0.55 * arm;
    path([1.25 * arm, 0], [0.9 * arm, 0.6 * half], [0.5 * arm, half], [-arm, half], [-arm, -half], [0.5 * arm, -half], [0.9 * arm, -0.6 * half]);
    this.context.closePath();
  }

  // Where the ground station has the craft, in the real loop.
  estimate({ x_told_received: x, y_told_received: y, psi_told_received: psi }) {
    if (x === undefined) return;
    const [cos, sin] = [Math.cos(psi), Math.sin(psi)];
    this.hull(this.pathOf((a, b) => this.toScreen(x + cos * a - sin * b, y + sin * a + cos * b)), this.about?.arm ?? 0.2);
    const c = this.context;
    c.setLineDash([4, 4]);
    c.strokeStyle = this.color.soft;
    c.lineWidth = 1.5;
    c.stroke();
    c.setLineDash([]);
  }

  heading(signals) {
    const { context: c } = this;
    const reach = 4 * (this.about?.arm ?? 0.2);
    const angle = signals.heading_ref;
    c.setLineDash([6, 5]);
    this.line([[signals.x, signals.y], [signals.x + reach * Math.cos(angle), signals.y + reach * Math.sin(angle)]], this.color.goal, 2);
    c.setLineDash([]);
  }

  goal(signals) {
    const { context: c, color } = this;
    const place = this.toScreen(signals.goal_x_ref, signals.goal_y_ref);
    const angle = -signals.goal_heading_ref;
    c.strokeStyle = color.goal;
    c.lineWidth = 2;
    c.beginPath();
    c.arc(...place, 9, 0, 7);
    c.stroke();
    this.arrow(place, [place[0] + 28 * Math.cos(angle), place[1] + 28 * Math.sin(angle)], color.goal, 2);
  }

  wind({ wind_x, wind_y }) {
    const speed = Math.hypot(wind_x, wind_y);
    if (!(speed > 0.02)) return;
    const { context: c, color, size } = this;
    const middle = [size[0] - 60, size[1] - 70];
    const scale = 22 / Math.max(speed, 1.5);
    this.arrow([middle[0] - wind_x * scale, middle[1] + wind_y * scale], [middle[0] + wind_x * scale, middle[1] - wind_y * scale], color.air, 3);
    c.fillStyle = color.air;
    c.textAlign = "center";
    c.fillText(`wind ${speed.toFixed(1)} m/s`, middle[0], middle[1] + 38);
  }
}
